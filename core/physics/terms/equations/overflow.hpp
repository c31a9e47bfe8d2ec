// Overflow: what passes a limit goes elsewhere.
// Equation: s <= limit; share times the rate beyond it is added to the state under `with`
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct Overflow {
  static constexpr TermInfo info{
      .name = "overflow",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {},
      .parameters = {{{"limit", "*", {}, Role::shape, {1e300}, "where it runs over"},
                      {"share",
                       "*",
                       {0.0, 1e6},
                       Role::shape,
                       {0.5},
                       "share of the surplus that arrives at the other state"}}},
      .description = "A full vessel runs over; part of that arrives in the next one.",
      .source = "state held at the limit; share times the surplus rate is added to the other state"};
  static constexpr EquationsTermKind kind{.info = &info, .memory = EquationsMemory::overflow};
};

}  // namespace invar::physics::equations
