// Constant force: tilt, gravity, a weight on a string.
// Equation: F = force
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct ConstantForce {
  static constexpr TermInfo info{
      .name = "constant_force",
      .plant = Plant::axis,
      .site = "force",
      .depends_on = {},
      .parameters = {{{"force", "N", {-2000.0, 2000.0}, Role::amplitude, {0.3}, "towards +x"}}},
      .description = "The axis is not level, or a weight or a spring of constant force pulls at it.",
      .source = "F = mass g sin(tilt)",
      .is_steady = true};
  static double force(const AxisPoint& /*at*/, const double* p) { return p[0]; }
  static constexpr AxisTermKind kind{.info = &info, .force = force};
};

}  // namespace invar::physics
