// Force ripple: a force that repeats along the way.
// Equation: F = amplitude sin(2 pi position / pitch + phase)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct ForceRipple {
  static constexpr TermInfo info{
      .name = "force_ripple",
      .plant = Plant::axis,
      .site = "force",
      .depends_on = {"position"},
      .parameters = {{{"amplitude", "N", {0.0, 500.0}, Role::amplitude, {0.3}, "size of the ripple"},
                      {"pitch", "m", {1e-4, 0.5}, Role::shape, {0.03}, "length of a period"},
                      {"phase", "rad", {-7.0, 7.0}, Role::phase, {0.0}, "phase at position zero"}}},
      .description =
          "Cogging: the magnets pull the iron of the carriage towards places that repeat with the "
          "pole pitch, whether or not a current flows.",
      .source = "Otten, de Vries, van Amerongen, IEEE/ASME Trans. Mechatronics 2 (1997), sect. II",
      .told_apart = {{{"motor_constant_ripple",
                       "cross the same places at high and at low current: the ripple of the motor constant "
                       "goes with the current"}}}};
  static double force(const AxisPoint& at, const double* p) {
    return p[0] * std::sin(2.0 * std::numbers::pi * at.position / p[1] + p[2]);
  }
  static constexpr AxisTermKind kind{.info = &info, .force = force};
};

}  // namespace invar::physics
