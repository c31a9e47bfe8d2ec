// Lower limit: the variable cannot fall below a value.
// Equation: max(w, limit) takes the place of w
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct LowerLimit {
  static constexpr TermInfo info{
      .name = "lower_limit",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {},
      .parameters = {{{"limit", "*", {}, Role::shape, {-1e300}, "smallest value"}}},
      .description = "A stop, a bottom, an end of a range.",
      .source = "max(s, limit)",
      .cut = Cut::beyond_a_limit};
  static constexpr EquationsTermKind kind{.info = &info, .memory = EquationsMemory::lower_limit};
};

}  // namespace invar::physics::equations
