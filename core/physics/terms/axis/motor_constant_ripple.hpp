// Motor constant ripple: the force per ampere varies along the magnets.
// Equation: F = k_f current (1 + amplitude sin(2 pi position / pitch + phase))
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct MotorConstantRipple {
  static constexpr TermInfo info{
      .name = "motor_constant_ripple",
      .plant = Plant::axis,
      .site = "actuator",
      .depends_on = {"position", "current"},
      .parameters = {{{"amplitude", "1", {0.0, 0.5}, Role::amplitude, {0.01}, "relative size of the ripple"},
                      {"pitch", "m", {1e-4, 0.5}, Role::shape, {0.024}, "length of a period"},
                      {"phase", "rad", {-7.0, 7.0}, Role::phase, {0.0}, "phase at position zero"}}},
      .description =
          "Field and commutation are not perfect sines: the same current gives more force at one place "
          "than at another, and none where no current flows.",
      .source = "Rohrig, Jochheim, Proc. American Control Conference (2001): F = k_f u (1 + ripple)"};
  static double motor(const AxisPoint& at, const double* p) {
    return p[0] * std::sin(2.0 * std::numbers::pi * at.position / p[1] + p[2]);
  }
  static constexpr AxisTermKind kind{.info = &info, .motor = motor};
};

}  // namespace invar::physics
