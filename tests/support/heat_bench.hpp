// A temperature loop and the simulated heater that it keeps, over real Modbus TCP, in simulated time.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "components/thermal/thermal.hpp"
#include "components/world/simulated_heater.hpp"
#include "idl/event.h"
#include "tests/support/free_port.hpp"

namespace invar::thermal {

namespace fs = std::filesystem;

struct HeatBench final : Component {
  Output<ThermalCommand> command{*this, "command"};
  Input<NodeTemperature> state{*this, "state"};
  Input<NodeTemperature> base{*this, "base"};
  Input<NodeTemperature> true_slide{*this, "true_slide"};
  Input<NodeTemperature> true_base{*this, "true_base"};
  Inbox<event::Notice> notices{*this, "notices", {}, 4096};

  world::SimulatedHeater::Parameters heater_parameters;
  Thermal::Parameters thermal_parameters;
  std::unique_ptr<world::SimulatedHeater> heater;
  std::unique_ptr<Thermal> thermal;
  std::uint64_t cycle = 0;
  static constexpr double period = 0.1;

  explicit HeatBench(const fs::path& faults = {}) {
    const auto port = test::free_port();
    heater_parameters.modbus.map = INVAR_SOURCE_DIR "/deployment/maps/heater.yaml";
    heater_parameters.modbus.port = port;
    heater_parameters.modbus.faults = faults;
    heater_parameters.noise = 0.0;
    thermal_parameters.modbus.map = heater_parameters.modbus.map;
    thermal_parameters.modbus.port = port;
    thermal_parameters.power_limit = 120.0;
    thermal_parameters.pid.kp = 60.0;
    thermal_parameters.pid.ki = 0.4;
    thermal_parameters.zones = {{"base", {}}};
  }
  void bring_up() {
    heater = std::make_unique<world::SimulatedHeater>(heater_parameters);
    thermal = std::make_unique<Thermal>(thermal_parameters);
    for (Component* component :
         {static_cast<Component*>(heater.get()), static_cast<Component*>(thermal.get())}) {
      component->simulated_time = true;
      component->configure();
    }
    static_cast<OutputPort*>(thermal->find_port("state"))->connect(state);
    static_cast<OutputPort*>(thermal->find_port("temperature_base"))->connect(base);
    static_cast<OutputPort*>(thermal->find_port("notices"))->connect(notices);
    static_cast<OutputPort*>(heater->find_port("slide"))->connect(true_slide);
    static_cast<OutputPort*>(heater->find_port("base"))->connect(true_base);
    command.connect(*static_cast<InputPort*>(thermal->find_port("command")));
    heater->activate();
    thermal->activate();
  }
  void step(const Tick&) noexcept override {}

  [[nodiscard]] Instant at() const {
    return Instant{} + Duration::milliseconds(100) * static_cast<std::int64_t>(cycle);
  }
  const NodeTemperature& cycle_once(bool owner_lives = true) {
    const Tick tick{at(), period, cycle++};
    for (Component* component : {static_cast<Component*>(this), static_cast<Component*>(heater.get()),
                                 static_cast<Component*>(thermal.get())})
      component->set_now(tick.now);
    heater->step(tick);
    if (owner_lives) thermal->step(tick);
    return *state.latest();
  }
  /// What the pad gets in fact, asked from the device by a master of its own.
  [[nodiscard]] double heater_power() const {
    modbus::Bus bus{{.port = static_cast<std::uint16_t>(heater_parameters.modbus.port)}};
    const modbus::Device& device = bus.add(modbus::load_map(heater_parameters.modbus.map));
    EXPECT_TRUE(bus.exchange(at()));
    return device.value("delivered_power").value;
  }
  /// What was said since the last call.
  std::vector<std::string> said() {
    std::vector<std::string> texts;
    event::Notice notice;
    while (notices.take(notice)) texts.emplace_back(notice.text().c_str());
    return texts;
  }
  void ask(double setpoint, bool enabled = true) {
    ThermalCommand sample;
    sample.setpoint(setpoint);
    sample.enabled(enabled);
    command.write(sample);
  }
  void send_reset(double setpoint = 30.0) {
    ThermalCommand reset;
    reset.setpoint(setpoint);
    reset.enabled(true);
    reset.reset_latch(true);
    command.write(reset);
  }
  NodeTemperature run_for(double seconds) {
    NodeTemperature last;
    for (const Instant end = at() + Duration::seconds(seconds); at() < end;) last = cycle_once();
    return last;
  }
};

}  // namespace invar::thermal
