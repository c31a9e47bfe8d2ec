// Delay: an input acts, an output shows, or a state is felt, some time later.
// Equation: w(t - delay) takes the place of w(t)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct Delay {
  static constexpr TermInfo info{
      .name = "delay",
      .plant = Plant::equations,
      .site = "input",
      .depends_on = {"history"},
      .parameters = {{{"delay", "*", {0.0, 1e6}, Role::amplitude, {1e-3}, "in the unit of time"}}},
      .description = "Transport through a pipe, a bus or a computation.",
      .source = "s(t - delay); of a state: in all rates, or (`with: others`) in all but its own",
      .lateness = Lateness::delay,
      .told_apart = {{{"lag",
                       "change the input quickly, up to the rate of the rows: a delay keeps the shape, a lag "
                       "rounds it"}}}};
  static constexpr EquationsTermKind kind{.info = &info, .memory = EquationsMemory::delay};
};

}  // namespace invar::physics::equations
