// Air drag: still air slows the drop in all directions while gravity goes on.
// Equation: m dw/dt = m g - 3 pi mu diameter w (1 + 0.15 Re^0.687), w the velocity of the drop
#pragma once

#include <cmath>

#include "core/physics/droplet_hooks.hpp"

namespace invar::physics::droplet {

struct AirDrag {
  static constexpr TermInfo info{
      .name = "air_drag",
      .plant = Plant::droplet,
      .site = "flight",
      .depends_on = {"height", "velocity"},
      .parameters = {{{"diameter",
                       "m",
                       {5e-6, 5e-3},
                       Role::shape,
                       {1e-4, 5e-5, 2e-4},
                       "diameter of the drop (water)"}}},
      .description =
          "Small drops are braked by the air: they fly longer, and what they carry sideways fades.",
      .source = "Schiller and Naumann 1933: Stokes drag times 1 + 0.15 Re^0.687"};
  static void apply(Droplet& d, const double* p) { d.diameter = p[0]; }
  static constexpr DropletTermKind kind{.info = &info, .apply = apply};
};

}  // namespace invar::physics::droplet
