#include "components/world/simulated_pneumatics.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace invar::world {

SimulatedPneumatics::SimulatedPneumatics(const Parameters& parameters) : parameters_{parameters} {
  const auto map = modbus::load_map_of(parameters.modbus.map, "map", "pneumatic controller",
                                       {{"pressure", "Pa"},
                                        {"enable"},
                                        {"actual_pressure", "Pa"},
                                        {"in_band"},
                                        {"over_pressure"},
                                        {"sensor_fault"}});
  if (!parameters.modbus.faults.empty()) (void)modbus::load_faults(parameters.modbus.faults, map);
}

void SimulatedPneumatics::configure() { server_ = modbus::serve(parameters_.modbus); }

void SimulatedPneumatics::cleanup() noexcept { server_.reset(); }

void SimulatedPneumatics::activate() {
  random_.seed(static_cast<std::uint64_t>(parameters_.seed));
  normal_.reset();
  pressure_ = purge_pressure_ = 0.0;
  over_pressure_ = false;
}

void SimulatedPneumatics::step(const Tick& tick) noexcept {
  modbus::Server& registers = *server_;
  // Once a step: what the last one computed becomes visible, what masters wrote since arrives, and a lost master has by
  // now shut the supply.
  registers.exchange(tick.now);
  if (registers.value("reset_alarms") != 0.0) {
    over_pressure_ = false;
    registers.set("reset_alarms", 0.0);
  }
  if (pressure_ > parameters_.over_pressure) over_pressure_ = true;
  const double setpoint = registers.value("pressure");
  const bool on = registers.value("enable") != 0.0 && !over_pressure_;
  const bool purging = registers.value("purge") != 0.0 && !over_pressure_;
  const double regulated = std::min(setpoint + parameters_.leak_through, parameters_.supply);
  const double share = -std::expm1(-tick.period / parameters_.lag);
  pressure_ += share * ((on ? regulated : 0.0) - pressure_);
  purge_pressure_ +=
      share *
      ((purging ? std::min(registers.value("purge_pressure"), parameters_.supply) : 0.0) - purge_pressure_);

  const double reading = pressure_ + parameters_.noise * normal_(random_);
  const bool supply_low = on && parameters_.supply < setpoint;
  registers.set("actual_pressure", reading);
  registers.set("actual_purge_pressure", purge_pressure_ + parameters_.noise * normal_(random_));
  registers.set("supply_pressure", parameters_.supply);
  registers.set("in_band", on && std::abs(reading - setpoint) <= registers.value("band") ? 1.0 : 0.0);
  registers.set("supply_low", supply_low ? 1.0 : 0.0);
  registers.set("over_pressure", over_pressure_ ? 1.0 : 0.0);
  registers.set("sensor_fault", parameters_.sensor_fault ? 1.0 : 0.0);
  registers.set("ready", over_pressure_ || parameters_.sensor_fault ? 0.0 : 1.0);

  dispensing::PressureState sample;
  stamp(sample);
  sample.node(id);
  sample.pressure(pressure_);
  sample.setpoint(setpoint);
  sample.purge_pressure(purge_pressure_);
  sample.enabled(on);
  sample.purging(purging);
  sample.supply_low(supply_low);
  sample.over_pressure(over_pressure_);
  sample.sensor_fault(parameters_.sensor_fault);
  sample.comm_lost(registers.comm_lost());
  actual_.write(sample);
}

}  // namespace invar::world
