// Lag: an input acts, an output shows, or a state is felt, with a time constant.
// Equation: z takes the place of w, dz/dt = (w - z) / time_constant
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct Lag {
  static constexpr TermInfo info{
      .name = "lag",
      .plant = Plant::equations,
      .site = "input",
      .depends_on = {"history"},
      .parameters = {{{"time_constant", "*", {0.0, 1e9}, Role::amplitude, {1e-3}, "in the unit of time"}}},
      .description = "An actuator or a sensor that follows like a first-order lag.",
      .source =
          "z for s, dz/dt = (s - z) / time_constant; of a state: in all rates, or (`with: others`) in all "
          "but its own",
      .lateness = Lateness::lag};
  static constexpr EquationsTermKind kind{.info = &info, .memory = EquationsMemory::lag};
};

}  // namespace invar::physics::equations
