#include "components/stage/command_check.hpp"

#include <cmath>

namespace invar::stage {

NumberFault fault_in(const AxisCommand& command) noexcept {
  constexpr const char* any = "a finite number";
  constexpr const char* not_negative = "a positive number, or 0 for the axis's own";
  constexpr const char* positive = "a positive number";
  const bool moves = command.kind() == AXIS_COMMAND_MOVE;
  const bool has_limits = moves || command.kind() == AXIS_COMMAND_HOME;
  const bool is_sine = command.kind() == AXIS_COMMAND_SINE;
  const struct {
    bool used;
    const char* name;
    double value;
    const char* want;
  } members[] = {{moves, "position", command.position(), any},
                 {has_limits, "velocity", command.velocity(), not_negative},
                 {has_limits, "acceleration", command.acceleration(), not_negative},
                 {has_limits, "jerk", command.jerk(), not_negative},
                 {is_sine, "amplitude", command.amplitude(), any},
                 {is_sine, "period", command.period(), positive}};
  for (const auto& member : members) {
    if (!member.used) continue;
    const bool sound = std::isfinite(member.value) && (member.want == any || member.value > 0.0 ||
                                                       (member.want == not_negative && member.value == 0.0));
    if (!sound) return {member.name, member.value, member.want};
  }
  return {};
}

const char* why_refused(const AxisCommand& command, AxisMode mode, bool homed, const Range& travel) noexcept {
  if (mode == AXIS_MODE_FAULT) return "the axis is in fault: clear the fault and enable it first";
  if (mode == AXIS_MODE_DISABLED) return "the axis is not enabled: enable it first";
  if (mode != AXIS_MODE_HOLDING) return "the axis moves: wait until it holds, or stop it first";
  if (command.kind() != AXIS_COMMAND_HOME && !homed) return "the axis is not homed: home it first";
  if (command.kind() == AXIS_COMMAND_SINE)
    return "the sine leaves the travel, takes for ever, or is faster than the axis's limits: make it smaller "
           "or slower";
  if (command.kind() == AXIS_COMMAND_MOVE && !travel.contains(command.position()))
    return "the target is outside the axis's travel: choose one inside";
  return "its limits are so small that it would not end: raise them, or send 0 for the axis's own";
}

const char* kind_text(AxisCommandKind kind) noexcept {
  switch (kind) {
    case AXIS_COMMAND_ENABLE:
      return "enabling";
    case AXIS_COMMAND_DISABLE:
      return "disabling";
    case AXIS_COMMAND_HOME:
      return "homing";
    case AXIS_COMMAND_MOVE:
      return "a move";
    case AXIS_COMMAND_STOP:
      return "a stop";
    case AXIS_COMMAND_CLEAR_FAULT:
      return "clearing the fault";
    case AXIS_COMMAND_SINE:
      return "a sine";
  }
  return "a command";
}

}  // namespace invar::stage
