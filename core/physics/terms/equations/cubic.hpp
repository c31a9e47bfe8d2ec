// Cubic: a rate that goes with the third power.
// Equation: ds/dt += coefficient w^3, w the variable under `with`, or the state
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct Cubic {
  static constexpr TermInfo info{
      .name = "cubic",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {},
      .parameters = {{{"coefficient", "*", {}, Role::amplitude, {0.01}, "rate per cube"}}},
      .description = "A spring that hardens or softens, or another odd characteristic.",
      .source = "Duffing 1918: s^3",
      .power = 3,
      .joined_by = "in"};
  static double rate(double s, const double* p) { return p[0] * s * s * s; }
  static constexpr EquationsTermKind kind{.info = &info, .rate = rate};
};

}  // namespace invar::physics::equations
