// Upper limit: the variable cannot rise above a value.
// Equation: min(w, limit) takes the place of w
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct UpperLimit {
  static constexpr TermInfo info{.name = "upper_limit",
                                 .plant = Plant::equations,
                                 .site = "state",
                                 .depends_on = {},
                                 .parameters = {{{"limit", "*", {}, Role::shape, {1e300}, "largest value"}}},
                                 .description = "A stop, an edge, an end of a range.",
                                 .source = "min(s, limit)",
                                 .cut = Cut::beyond_a_limit};
  static constexpr EquationsTermKind kind{.info = &info, .memory = EquationsMemory::upper_limit};
};

}  // namespace invar::physics::equations
