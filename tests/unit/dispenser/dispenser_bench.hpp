// A dispenser on the simulated pneumatic controller over real Modbus TCP, in simulated time; a valve hears its pressure.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "components/dispenser/dispenser.hpp"
#include "components/dispenser/valve.hpp"
#include "components/world/simulated_pneumatics.hpp"
#include "idl/event.h"
#include "tests/support/free_port.hpp"

namespace invar::dispenser::testing {

namespace fs = std::filesystem;
using namespace dispensing;

struct DispenserBench final : Component {
  Output<PressureCommand> command{*this, "command"};
  Output<PatternCommand> print{*this, "print"};
  Output<compensation::ModelCommand> model{*this, "model"};
  Output<stage::AxisState> axis{*this, "axis"};
  Output<TriggerCommand> trigger{*this, "trigger"};
  Output<TriggerPattern> chase{*this, "chase"};
  Input<PressureState> pressure{*this, "pressure"};
  Input<PressureState> actual{*this, "actual"};
  Inbox<TriggerPattern> pattern{*this, "pattern"};
  Inbox<event::Notice> notices{*this, "notices", {}, 4096};
  Input<compensation::ModelStatus> status{*this, "status"};
  Inbox<DropletJetted> jetted{*this, "jetted", {}, 4096};
  Inbox<DropletRefused> refused{*this, "refused", {}, 4096};

  world::SimulatedPneumatics::Parameters device_parameters;
  Dispenser::Parameters parameters;
  Valve::Parameters valve_parameters;
  std::unique_ptr<world::SimulatedPneumatics> device;
  std::unique_ptr<Dispenser> dispenser;
  std::unique_ptr<Valve> valve;
  std::uint64_t cycle = 0;
  static constexpr double period = 0.02;

  explicit DispenserBench(const fs::path& fault_script = {}) {
    const auto port = test::free_port();
    device_parameters.modbus.map = INVAR_SOURCE_DIR "/deployment/maps/pneumatic.yaml";
    device_parameters.modbus.port = port;
    device_parameters.modbus.faults = fault_script;
    parameters.modbus.map = device_parameters.modbus.map;
    parameters.modbus.port = port;
    parameters.pressurise = true;
    Pattern& grid = parameters.patterns.emplace_back();
    grid.name = "grid";
    grid.from = {0.06, 0.05};
    grid.pitch = {2e-3, 1e-3};
    grid.columns = 3;
    grid.rows = 2;
  }
  static InputPort& input_of(Component& component, const char* port) {
    return *static_cast<InputPort*>(component.find_port(port));
  }
  static OutputPort& output_of(Component& component, const char* port) {
    return *static_cast<OutputPort*>(component.find_port(port));
  }
  void bring_up() {
    device = std::make_unique<world::SimulatedPneumatics>(device_parameters);
    dispenser = std::make_unique<Dispenser>(parameters);
    valve = std::make_unique<Valve>(valve_parameters);
    for (Component* component : all()) {
      component->simulated_time = true;
      component->configure();
    }
    command.connect(input_of(*dispenser, "command"));
    print.connect(input_of(*dispenser, "print"));
    model.connect(input_of(*dispenser, "model"));
    output_of(*dispenser, "pressure").connect(pressure);
    output_of(*dispenser, "pressure").connect(input_of(*valve, "pressure"));
    output_of(*dispenser, "pattern").connect(pattern);
    output_of(*dispenser, "status").connect(status);
    output_of(*dispenser, "notices").connect(notices);
    output_of(*device, "actual").connect(actual);
    axis.connect(input_of(*valve, "state_x"));
    axis.connect(input_of(*valve, "state_y"));
    trigger.connect(input_of(*valve, "command"));
    chase.connect(input_of(*valve, "pattern"));
    output_of(*valve, "jetted").connect(jetted);
    output_of(*valve, "refused").connect(refused);
    for (Component* component : all()) component->activate();
  }
  std::vector<Component*> all() const { return {device.get(), dispenser.get(), valve.get()}; }
  void step(const Tick&) noexcept override {}

  [[nodiscard]] Instant at() const {
    return Instant{} + Duration::milliseconds(20) * static_cast<std::int64_t>(cycle);
  }
  const PressureState& cycle_once(bool owner_lives = true) {
    const Tick tick{at(), period, cycle++};
    set_now(tick.now);
    for (Component* component : all()) component->set_now(tick.now);
    device->step(tick);
    if (owner_lives) dispenser->step(tick);
    return *pressure.latest();
  }
  std::vector<std::string> said() {
    std::vector<std::string> texts;
    event::Notice notice;
    while (notices.take(notice)) texts.emplace_back(notice.text().c_str());
    return texts;
  }
  PressureState run_for(double seconds, bool owner_lives = true) {
    PressureState last;
    for (const Instant end = at() + Duration::seconds(seconds); at() < end;) last = cycle_once(owner_lives);
    return last;
  }
  /// Whether the valve jets now: a droplet by command over an armed pattern, on a stage that stands there.
  bool jets() {
    const Tick tick{at(), 1e-3, cycle};
    set_now(tick.now);
    valve->set_now(tick.now);
    stage::AxisState state;
    state.at().time_ns(tick.now.ns);
    state.enabled(true);
    state.homed(true);
    axis.write(state);
    TriggerPattern armed;
    armed.id(1);
    armed.points().resize(1);
    chase.write(armed);
    TriggerCommand arm;
    arm.pattern_id(1);
    arm.kind(TRIGGER_ARM);
    trigger.write(arm);
    arm.kind(TRIGGER_JET_NOW);
    trigger.write(arm);
    DropletJetted one;
    while (jetted.take(one)) {
    }
    valve->step(tick);
    return jetted.take(one);
  }
  RefusalReason why() {
    DropletRefused last;
    while (refused.take(last)) {
    }
    return last.reason();
  }
  TriggerPattern ask(const std::string& wanted_name, double height) {
    PatternCommand wanted;
    wanted.id(cycle + 1);
    wanted.name(wanted_name);
    wanted.height(height);
    print.write(wanted);
    cycle_once();
    TriggerPattern answer;
    EXPECT_TRUE(pattern.take(answer));
    EXPECT_EQ(answer.id(), wanted.id());
    return answer;
  }
  compensation::ModelStatus change(compensation::ModelCommandKind kind, const fs::path& path = {}) {
    compensation::ModelCommand sample;
    sample.id(cycle + 1000);
    sample.kind(kind);
    sample.path(path.string());
    model.write(sample);
    cycle_once();
    EXPECT_EQ(status.latest()->command_id(), sample.id());
    return *status.latest();
  }
};

}  // namespace invar::dispenser::testing
