// Hidden state: something behind the state stores and gives back.
// Equation: coefficient (z - w) is added, dz/dt = (w - z) / time_constant, z(0) = w(0)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct HiddenState {
  static constexpr TermInfo info{
      .name = "hidden_state",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {"history"},
      .parameters = {{{"coefficient", "*", {0.0, 1e300}, Role::amplitude, {0.01}, "rate per difference"},
                      {"time_constant",
                       "*",
                       {1e-9, 1e12},
                       Role::shape,
                       {1.0, 0.1, 10.0},
                       "time constant of the store"}}},
      .description = "A second store behind the state or on the way of a signal that nobody measures.",
      .source =
          "adds coefficient (z - s), of a state to its rate, of an input or output to itself (then a share); "
          "dz/dt = (s - z) / "
          "time_constant, z in balance at the start",
      .lateness = Lateness::store};
  static constexpr EquationsTermKind kind{.info = &info, .memory = EquationsMemory::hidden_state};
};

}  // namespace invar::physics::equations
