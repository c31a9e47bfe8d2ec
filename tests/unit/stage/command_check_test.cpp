// Commands whose numbers no axis could carry out.
#include "components/stage/command_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace invar::stage {
namespace {

constexpr double inf = std::numeric_limits<double>::infinity();

AxisCommand order(AxisCommandKind kind) {
  AxisCommand command;
  command.kind(kind);
  command.period(1.0);
  return command;
}

TEST(CommandCheck, EveryNumberThatAKindUsesIsFiniteAndLimitsAreNotNegative) {
  using Set = void (AxisCommand::*)(double);
  const struct {
    const char* member;
    Set set;
    bool moves, homes, sine, may_be_negative, may_be_zero;
  } members[] = {{"position", &AxisCommand::position, true, false, false, true, true},
                 {"velocity", &AxisCommand::velocity, true, true, false, false, true},
                 {"acceleration", &AxisCommand::acceleration, true, true, false, false, true},
                 {"jerk", &AxisCommand::jerk, true, true, false, false, true},
                 {"amplitude", &AxisCommand::amplitude, false, false, true, true, true},
                 {"period", &AxisCommand::period, false, false, true, false, false}};
  for (const auto kind : {AXIS_COMMAND_ENABLE, AXIS_COMMAND_DISABLE, AXIS_COMMAND_HOME, AXIS_COMMAND_MOVE,
                          AXIS_COMMAND_STOP, AXIS_COMMAND_CLEAR_FAULT, AXIS_COMMAND_SINE})
    for (const auto& member : members)
      for (const double value : {std::nan(""), inf, -inf, -0.1, 0.0, 0.1}) {
        AxisCommand command = order(kind);
        (command.*member.set)(value);
        const bool used = (kind == AXIS_COMMAND_MOVE && member.moves) ||
                          (kind == AXIS_COMMAND_HOME && member.homes) ||
                          (kind == AXIS_COMMAND_SINE && member.sine);
        const bool sound = std::isfinite(value) && (value > 0.0 || (value == 0.0 && member.may_be_zero) ||
                                                    (value < 0.0 && member.may_be_negative));
        const NumberFault fault = fault_in(command);
        if (used && !sound)
          EXPECT_STREQ(fault.member, member.member) << kind << ' ' << value;
        else  // a stop is a stop whatever its numbers
          EXPECT_EQ(fault.member, nullptr) << kind << ' ' << member.member << ' ' << value;
      }
}

}  // namespace
}  // namespace invar::stage
