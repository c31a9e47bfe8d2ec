// JobAxis: one axis that a job moves - its ports, and what the job watches while a motion is under way.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "components/calibration/axis_link.hpp"
#include "components/calibration/loop_watch.hpp"
#include "core/component/component.hpp"
#include "core/job/task.hpp"
#include "idl/stage.h"

namespace invar::calibration {

/// Not real-time.
class JobAxis {
 public:
  /// `number`: of the axis in its commands; outlives this. The ports are those of `owner`.
  JobAxis(Component& owner, const std::int64_t& number, const std::string& state_port,
          const std::string& command_port)
      : state{owner, state_port}, owner_{owner}, number_{number}, command_{owner, command_port, "command"} {}

  /// Stamps the command and sends it as number `id`; a motion that was watched is over.
  void send(stage::AxisCommand command, std::uint64_t id);
  /// The axis has answered the newest command.
  [[nodiscard]] bool has_answered();

  struct Motion {
    bool answered = false, done = false, settled = false;
  };
  /// Once a step of a motion. `refused`: what the job says of an axis that does not begin it. Throws std::runtime_error where
  /// the axis tripped, stopped, is not heard, or has a loop at its current limit or that swings.
  Motion follow(const std::string& refused);

  [[nodiscard]] const Component& owner() const { return owner_; }
  /// "stage_x", or "axis x".
  [[nodiscard]] std::string said() const { return axis_name(state.topic, number_); }
  /// Addition to the notice of an axis that does not settle: "; <figures>", or "".
  [[nodiscard]] std::string figures() const { return loop_.figures(); }

  Input<stage::AxisState> state;

 private:
  Component& owner_;
  const std::int64_t& number_;
  Output<stage::AxisCommand> command_;
  std::uint64_t last_command_ = 0;
  LoopWatch loop_;  // of the motion under way
  AxisLink link_;
  bool taken_ = false;  // the motion is under way
};

/// Numbers for commands, never given before.
using CommandIds = std::function<std::uint64_t()>;

/// The one rule by which a job enables its axes. Processes come up in any order: an axis that does not answer is asked again each
/// 0.5 s. One that refuses says why in a notice, and is asked again after 2 s. One that tripped is never asked again.
/// Throws std::runtime_error where an axis tripped, or is not enabled within `patience`.
job::Task enable_axes(std::vector<JobAxis*> axes, CommandIds next_id, Duration patience);

}  // namespace invar::calibration
