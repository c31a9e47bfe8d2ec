// Linear: a rate in proportion to the state itself.
// Equation: ds/dt += coefficient s
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct Linear {
  static constexpr TermInfo info{
      .name = "linear",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {},
      .parameters = {{{"coefficient", "*", {}, Role::amplitude, {0.01}, "rate per state"}}},
      .description = "A leak, a damping or a spring in proportion that the equations leave out.",
      .source = "series of the missing rate, first order",
      .power = 1,
      .joined_by = "in"};
  static double rate(double s, const double* p) { return p[0] * s; }
  static constexpr EquationsTermKind kind{.info = &info, .rate = rate};
};

}  // namespace invar::physics::equations
