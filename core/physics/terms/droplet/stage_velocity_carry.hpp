// Stage velocity carry: the drop keeps the velocity of the stage while it falls.
// Equation: shift = velocity height / speed
#pragma once

#include <cmath>

#include "core/physics/droplet_hooks.hpp"

namespace invar::physics::droplet {

struct StageVelocityCarry {
  static constexpr TermInfo info{
      .name = "stage_velocity_carry",
      .plant = Plant::droplet,
      .site = "flight",
      .depends_on = {"velocity", "height"},
      .parameters = {{{"speed", "m/s", {0.05, 50.0}, Role::shape, {3.0}, "speed of the drop at the nozzle"}}},
      .description =
          "Printing on the fly, the drop flies on with the stage: it lands velocity times flight time ahead.",
      .source = "shift = velocity height / speed",
      .needs = "velocity_x",
      .told_apart = {{{"valve_delay",
                       "print at two clearly different heights: carry grows with the height, a valve delay "
                       "does not"}}}};
  static void apply(Droplet& d, const double* p) {
    d.speed = p[0];
    d.carried = true;
  }
  static constexpr DropletTermKind kind{.info = &info, .apply = apply};
};

}  // namespace invar::physics::droplet
