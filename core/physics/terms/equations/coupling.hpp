// Coupling: a rate in proportion to another state or input.
// Equation: ds/dt += coefficient w, w the variable under `with`
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct Coupling {
  static constexpr TermInfo info{
      .name = "coupling",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {},
      .parameters = {{{"coefficient", "*", {}, Role::amplitude, {0.01}, "rate per variable"}}},
      .description = "Another part of the system acts here, which the equations leave out.",
      .source = "linear in the other variable",
      .power = 1,
      .joined_by = "to"};
  static double rate(double s, const double* p) { return p[0] * s; }
  static constexpr EquationsTermKind kind{.info = &info, .rate = rate};
};

}  // namespace invar::physics::equations
