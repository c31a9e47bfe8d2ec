// Dead zone: small inputs, or small values of a state, do nothing.
// Equation: w - width sign(w) takes the place of w for |w| > width, else 0
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct DeadZone {
  static constexpr TermInfo info{
      .name = "dead_zone",
      .plant = Plant::equations,
      .site = "input",
      .depends_on = {},
      .parameters = {{{"width", "*", {0.0, 1e300}, Role::amplitude, {1e-3}, "on each side of zero"}}},
      .description = "Play, overlap of a valve, cross-over of an amplifier.",
      .source =
          "s - width sign(s) where |s| > width, else 0; of a state: in all rates, or (`with: others`) in all "
          "but its own",
      .sticks_and_slips = true,
      .cut = Cut::around_zero};
  static constexpr EquationsTermKind kind{.info = &info, .memory = EquationsMemory::dead_zone};
};

}  // namespace invar::physics::equations
