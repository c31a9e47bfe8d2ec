// Amplifier lag: the current follows its command with a time constant.
// Equation: d current/dt = (u - current) / time_constant
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct AmplifierLag {
  static constexpr TermInfo info{
      .name = "amplifier_lag",
      .plant = Plant::axis,
      .site = "actuator",
      .depends_on = {"current", "frequency", "acceleration", "history"},
      .parameters = {{{"time_constant",
                       "s",
                       {0.0, 0.1},
                       Role::amplitude,
                       {2e-4},
                       "time constant of the current loop"}}},
      .description =
          "The current loop has a bandwidth: the motor current follows its command like a first-order lag.",
      .source = "di/dt = (u - i) / time_constant",
      .lateness = Lateness::lag};
  static constexpr AxisTermKind kind{.info = &info, .memory = AxisMemory::amplifier_lag};
};

}  // namespace invar::physics
