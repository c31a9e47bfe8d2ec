// Backlash: between carriage and encoder there is lost motion.
// Equation: the reading stays within position - width/2 .. position + width/2 and moves only at these limits
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct Backlash {
  static constexpr TermInfo info{
      .name = "backlash",
      .plant = Plant::axis,
      .site = "measurement",
      .depends_on = {"direction", "history"},
      .parameters = {{{"width", "m", {0.0, 1e-2}, Role::amplitude, {1e-6}, "the whole gap"}}},
      .description =
          "The encoder is driven through a gap: after a reversal it stands still until the gap is crossed.",
      .source = "play operator: y stays within x - width/2 .. x + width/2",
      .sticks_and_slips = true};
  static double play(double last, double position, const double* p) {
    const double half = 0.5 * p[0];
    return last < position - half ? position - half : (last > position + half ? position + half : last);
  }
  static constexpr AxisTermKind kind{.info = &info, .memory = AxisMemory::backlash};
};

}  // namespace invar::physics
