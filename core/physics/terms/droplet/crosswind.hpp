// Crosswind: moving air pushes the drop aside.
// Equation: shift = acceleration (height / speed)^2 / 2
#pragma once

#include <cmath>

#include "core/physics/droplet_hooks.hpp"

namespace invar::physics::droplet {

struct Crosswind {
  static constexpr TermInfo info{
      .name = "crosswind",
      .plant = Plant::droplet,
      .site = "flight",
      .depends_on = {"height"},
      .parameters = {{{"acceleration_x", "m/s2", {-1e4, 1e4}, Role::amplitude, {2.0}, "push along x"},
                      {"acceleration_y", "m/s2", {-1e4, 1e4}, Role::amplitude, {2.0}, "push along y"}}},
      .description =
          "A draught or an extraction pushes the drop: the shift grows with the square of the flight time.",
      .source = "shift = acceleration (height / speed)^2 / 2"};
  static void apply(Droplet& d, const double* p) { d.pull_x += p[0], d.pull_y += p[1]; }
  static constexpr DropletTermKind kind{.info = &info, .apply = apply};
};

}  // namespace invar::physics::droplet
