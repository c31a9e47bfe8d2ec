// Quadratic: a rate that goes with the variable times its size.
// Equation: ds/dt += coefficient w |w|, w the variable under `with`, or the state
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct Quadratic {
  static constexpr TermInfo info{
      .name = "quadratic",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {},
      .parameters = {{{"coefficient", "*", {}, Role::amplitude, {0.01}, "rate per square"}}},
      .description = "Drag of air or turbulent flow: it grows with the square and keeps its sign.",
      .source = "s |s|",
      .power = 2,
      .joined_by = "in"};
  static double rate(double s, const double* p) { return p[0] * s * std::abs(s); }
  static constexpr EquationsTermKind kind{.info = &info, .rate = rate};
};

}  // namespace invar::physics::equations
