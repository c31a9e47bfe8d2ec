// Periodic: a rate that repeats along a state or in time.
// Equation: ds/dt += amplitude sin(2 pi w / period + phase)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/equations_hooks.hpp"

namespace invar::physics::equations {

struct Periodic {
  static constexpr TermInfo info{
      .name = "periodic",
      .plant = Plant::equations,
      .site = "state",
      .depends_on = {},
      .parameters = {{{"amplitude", "*", {0.0, 1e300}, Role::amplitude, {0.01}, "size"},
                      {"period", "*", {1e-9, 1e12}, Role::shape, {1.0}, "period in the variable"},
                      {"phase", "rad", {-7.0, 7.0}, Role::phase, {0.0}, "at zero"}}},
      .description = "Something repeats: teeth, magnets, a pump, the day.",
      .source = "amplitude sin(2 pi s / period + phase)",
      .joined_by = "in"};
  static double rate(double s, const double* p) {
    return p[0] * std::sin(2.0 * std::numbers::pi * s / p[1] + p[2]);
  }
  static constexpr EquationsTermKind kind{.info = &info, .rate = rate};
};

}  // namespace invar::physics::equations
