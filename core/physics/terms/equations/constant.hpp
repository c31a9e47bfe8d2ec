// Constant: a rate that is always there.
// Equation: ds/dt += value
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct Constant {
  static constexpr TermInfo info{
      .name = "constant",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {},
      .parameters = {{{"value", "*", {}, Role::amplitude, {0.01}, "added to the rate"}}},
      .description = "An offset: a leak at constant rate, a tilt, a bias of an input.",
      .source = "constant rate",
      .is_steady = true};
  static double rate(double /*s*/, const double* p) { return p[0]; }
  static constexpr EquationsTermKind kind{.info = &info, .rate = rate};
};

}  // namespace invar::physics::equations
