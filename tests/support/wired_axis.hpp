// WiredAxis: one axis of the simulated world with its stage, and a hand that commands it; stepped without executor.
#pragma once

#include <string>
#include <utility>

#include "components/stage/axis_stage.hpp"
#include "components/world/simulated_stage.hpp"
#include "tests/support/wired.hpp"

namespace invar::support {

struct Hand final : Component {
  Output<stage::AxisCommand> command{*this, "command", "command"};
  Input<stage::AxisState> state{*this, "state"};
  void step(const Tick&) noexcept override {}
};

class WiredAxis {
 public:
  /// Joined, but not added: what comes between world and stage is added between them.
  WiredAxis(world::SimulatedStage::Parameters of_world_, stage::Stage::Parameters of_stage_,
            double period = 1e-3)
      : of_world{std::move(of_world_)},
        of_stage{std::move(of_stage_)},
        wired{period},
        letter{"xyz"[of_stage.axis]} {
    wired.join(stage, "motor", world, "motor_" + letter);
    wired.join(world, "feedback_" + letter, stage, "feedback");
    wired.join(stage, "state", hand, "state");
    wired.join(hand, "command", stage, "command");
  }
  void tell(stage::AxisCommandKind kind, double position = 0.0, double velocity = 0.0) {
    stage::AxisCommand told;
    told.kind(kind);
    told.axis(static_cast<std::uint32_t>(of_stage.axis));
    told.position(position);
    told.velocity(velocity);
    told.id(next++);
    hand.command.write(told);
  }

  world::SimulatedStage::Parameters of_world;
  stage::Stage::Parameters of_stage;
  Wired wired;
  std::string letter;
  world::SimulatedStage world{of_world};
  stage::Stage stage{of_stage};
  Hand hand;
  std::uint64_t next = 1;
};

}  // namespace invar::support
