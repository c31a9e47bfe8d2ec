// Slow drift: a force that grows with time.
// Equation: F = rate t
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct SlowDrift {
  static constexpr TermInfo info{
      .name = "slow_drift",
      .plant = Plant::axis,
      .site = "disturbance",
      .depends_on = {"time"},
      .parameters =
          {{{"rate", "N/s", {-100.0, 100.0}, Role::amplitude, {0.02}, "growth per second, from time zero"}}},
      .description =
          "A force that creeps: a cable that warms and stiffens, a counterweight that loses pressure.",
      .source = "F = rate t"};
  static double force(const AxisPoint& at, const double* p) { return p[0] * at.time; }
  static constexpr AxisTermKind kind{.info = &info, .force = force};
};

}  // namespace invar::physics
