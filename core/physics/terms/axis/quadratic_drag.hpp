// Quadratic drag: a force against the motion that grows with the square of the speed.
// Equation: F = -coefficient v |v|
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct QuadraticDrag {
  static constexpr TermInfo info{
      .name = "quadratic_drag",
      .plant = Plant::axis,
      .site = "force",
      .depends_on = {"velocity", "speed"},
      .parameters =
          {{{"coefficient", "N s2/m2", {0.0, 1e6}, Role::amplitude, {2.0}, "force per speed squared"}}},
      .description = "Air or liquid that is pushed aside, for instance in a narrow gap under the carriage.",
      .source = "F = -coefficient v |v|"};
  static double force(const AxisPoint& at, const double* p) {
    return -p[0] * at.velocity * std::abs(at.velocity);
  }
  static constexpr AxisTermKind kind{.info = &info, .force = force};
};

}  // namespace invar::physics
