// Dead zone: small commands give no current.
// Equation: current = u - width sign(u) for |u| > width, else 0
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct DeadZone {
  static constexpr TermInfo info{
      .name = "dead_zone",
      .plant = Plant::axis,
      .site = "actuator",
      .depends_on = {"current"},
      .parameters = {{{"width", "A", {0.0, 5.0}, Role::amplitude, {0.01}, "loss on each side of zero"}}},
      .description =
          "Cross-over of the output stage: commands smaller than the width give nothing, larger ones lose "
          "it.",
      .source = "u - width sign(u) where |u| > width, else 0",
      .sticks_and_slips = true,
      .cut = Cut::around_zero};
  static double command(double u, double /*time*/, double /*step*/, const double* p) {
    return u > p[0] ? u - p[0] : (u < -p[0] ? u + p[0] : 0.0);
  }
  static constexpr AxisTermKind kind{.info = &info, .command = command};
};

}  // namespace invar::physics
