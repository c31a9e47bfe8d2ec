// A process that is nothing but the temperature loop in real time, to be killed: heater_owner PORT
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "components/thermal/thermal.hpp"
#include "core/base/clock.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  invar::thermal::Thermal::Parameters parameters;
  parameters.modbus.port = std::atoi(argv[1]);
  parameters.modbus.map = INVAR_SOURCE_DIR "/deployment/maps/heater.yaml";
  parameters.setpoint = 50.0;
  invar::thermal::Thermal thermal{parameters};
  thermal.configure();
  thermal.activate();
  std::puts("running");
  std::fflush(stdout);
  for (std::uint64_t cycle = 0;; ++cycle) {
    const invar::Tick tick{invar::monotonic_now(), 0.05, cycle};
    thermal.set_now(tick.now);
    thermal.step(tick);
    std::this_thread::sleep_for(std::chrono::milliseconds{50});
  }
}
