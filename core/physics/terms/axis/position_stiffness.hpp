// Position stiffness: a spring between carriage and frame.
// Equation: F = -stiffness (position - center)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct PositionStiffness {
  static constexpr TermInfo info{
      .name = "position_stiffness",
      .plant = Plant::axis,
      .site = "force",
      .depends_on = {"position"},
      .parameters = {{{"stiffness", "N/m", {0.0, 1e6}, Role::amplitude, {5.0}, "force per way"},
                      {"center", "m", {-2.0, 2.0}, Role::shape, {0.0}, "where it pulls neither way"}}},
      .description = "A cable chain, a hose, a bellows or leaf springs pull the carriage towards one place.",
      .source = "Hooke: F = -stiffness (x - center)",
      .is_spring = true};
  static double force(const AxisPoint& at, const double* p) { return -p[0] * (at.position - p[1]); }
  static constexpr AxisTermKind kind{.info = &info, .force = force};
};

}  // namespace invar::physics
