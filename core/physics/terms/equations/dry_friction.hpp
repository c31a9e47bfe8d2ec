// Dry friction: a rate of constant size against the state, or against the state's own rate.
// Equation: ds/dt -= level sign(w); at standstill up to level against the other rates
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct DryFriction {
  static constexpr TermInfo info{
      .name = "dry_friction",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {"direction"},
      .parameters = {{{"level", "*", {0.0, 1e300}, Role::amplitude, {0.01}, "size of the rate"}}},
      .description = "Coulomb friction: constant size, against the motion, and it holds at rest.",
      .source =
          "-level sign(s), or -level sign(ds/dt) with the state itself. At standstill it holds up to the "
          "level. An output gets +level sign(s) of the variable under `with`",
      .is_friction = true};
  static constexpr EquationsTermKind kind{.info = &info, .memory = EquationsMemory::dry_friction};
};

}  // namespace invar::physics::equations
