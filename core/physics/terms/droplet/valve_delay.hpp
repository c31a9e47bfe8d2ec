// Valve delay: the drop leaves late.
// Equation: shift = velocity delay
#pragma once

#include <cmath>

#include "core/physics/droplet_hooks.hpp"

namespace invar::physics::droplet {

struct ValveDelay {
  static constexpr TermInfo info{
      .name = "valve_delay",
      .plant = Plant::droplet,
      .site = "valve",
      .depends_on = {"velocity"},
      .parameters = {{{"delay", "s", {0.0, 0.2}, Role::amplitude, {5e-4}, "from trigger to drop"}}},
      .description =
          "Between trigger and drop the stage moves on: the drop lands velocity times delay ahead.",
      .source = "shift = velocity delay",
      .needs = "velocity_x"};
  static void apply(Droplet& d, const double* p) { d.delay += p[0]; }
  static constexpr DropletTermKind kind{.info = &info, .apply = apply};
};

}  // namespace invar::physics::droplet
