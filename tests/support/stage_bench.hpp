// One axis of its own behind real ports, stepped by hand: a stage and the carriage that it moves.
#pragma once

#include <gtest/gtest.h>

#include <functional>

#include "components/stage/axis_stage.hpp"

namespace invar::stage {

/// A carriage without friction that the motor pushes, integrated exactly for a held force; behind real ports.
struct StageBench : Component {
  Input<MotorCommand> motor{*this, "motor"};
  Output<AxisFeedback> feedback{*this, "feedback"};
  Output<AxisCommand> command{*this, "command"};
  Output<compensation::AxisCorrection> correction{*this, "correction"};
  Input<AxisState> state{*this, "state"};
  Input<event::Notice> notices{*this, "notices"};

  Stage::Parameters parameters = [] {
    Stage::Parameters p;
    p.travel = {0.0, 0.2};
    p.control.feedforward_acceleration = mass / force_constant;
    return p;
  }();
  Stage stage{parameters};
  double position = 0.05;
  double velocity = 0.0;
  double spring = 0.0;  // N/m
  bool seeing = true;
  bool drive_fault = false;
  double encoder_error = 0.0;
  bool at_switch = false;
  std::uint64_t cycle = 0;
  std::uint64_t every = 1;    // cycles of the process a step
  std::uint64_t stretch = 1;  // ms a step, more than `own_period` while the rate of its loop is lowered
  double own_period = period;
  std::uint64_t next_id = 1;
  static constexpr double mass = 3.0;
  static constexpr double force_constant = 12.0;
  static constexpr double period = 1e-3;

  StageBench() {
    join(feedback, "feedback");
    join(command, "command");
    join(correction, "correction");
    static_cast<OutputPort*>(stage.find_port("motor"))->connect(motor);
    static_cast<OutputPort*>(stage.find_port("state"))->connect(state);
    static_cast<OutputPort*>(stage.find_port("notices"))->connect(notices);
    stage.activate();
  }
  void join(OutputPort& output, const char* port) {
    output.connect(*static_cast<InputPort*>(stage.find_port(port)));
  }
  void step(const Tick&) noexcept override {}

  const AxisState& cycle_once() {
    const double gone = static_cast<double>(stretch) * period;
    const Tick tick{Instant{static_cast<std::int64_t>(cycle) * 1'000'000}, gone, cycle * every, own_period};
    set_now(tick.now);
    stage.set_now(tick.now);
    const auto* drive = motor.latest();
    const double force = (drive != nullptr && drive->enabled() ? force_constant * drive->current() : 0.0) -
                         spring * (position - 0.05);
    position += velocity * gone + force / mass * gone * gone / 2;
    velocity += force / mass * gone;
    AxisFeedback sample;
    sample.position(position + encoder_error);
    sample.drive_fault(drive_fault);
    sample.velocity(velocity);
    sample.home_switch(at_switch || position < 0.0);
    if (seeing) feedback.write(sample);
    stage.step(tick);
    cycle += stretch;
    return *state.latest();
  }
  void send(AxisCommandKind kind, double target = 0.0) {
    AxisCommand sample;
    sample.id(next_id++);
    sample.kind(kind);
    sample.position(target);
    command.write(sample);
  }
  bool run_until(const std::function<bool(const AxisState&)>& reached, int cycles = 20'000) {
    for (int i = 0; i < cycles; ++i)
      if (reached(cycle_once())) return true;
    return false;
  }
  void enable() {
    cycle_once();
    send(AXIS_COMMAND_ENABLE);
    ASSERT_TRUE(run_until([](const AxisState& s) { return s.enabled(); }, 5));
  }
};

}  // namespace invar::stage
