// Motor heating: the motor current heats the node.
// Equation: P = resistance motor_current^2
#pragma once

#include <cmath>

#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

struct MotorHeating {
  static constexpr TermInfo info{
      .name = "motor_heating",
      .plant = Plant::thermal,
      .site = "source",
      .depends_on = {"motor_current"},
      .parameters = {{{"resistance",
                       "ohm",
                       {0.0, 1e3},
                       Role::amplitude,
                       {0.2},
                       "resistance of the winding, as far as its heat comes here"}}},
      .description = "The winding turns current into heat, part of which arrives at this node.",
      .source = "Joule: P = resistance I^2",
      .needs = "motor_current"};
  static double heat(const ThermalPoint& at, const double* p) {
    return p[0] * at.motor_current * at.motor_current;
  }
  static constexpr ThermalTermKind kind{.info = &info, .heat = heat};
};

}  // namespace invar::physics
