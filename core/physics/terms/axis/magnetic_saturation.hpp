// Magnetic saturation: the force per ampere falls at high current.
// Equation: F = k_f current (1 - coefficient current^2), the loss at most 0.6
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct MagneticSaturation {
  static constexpr TermInfo info{
      .name = "magnetic_saturation",
      .plant = Plant::axis,
      .site = "actuator",
      .depends_on = {"current"},
      .parameters = {{{"coefficient",
                       "1/A2",
                       {0.0, 100.0},
                       Role::amplitude,
                       {1e-3},
                       "relative loss per current squared"}}},
      .description = "The iron saturates: at high current each further ampere gives less force.",
      .source = "F = k_f u (1 - coefficient u^2), first even term of the series"};
  static double motor(const AxisPoint& at, const double* p) {
    const double loss = p[0] * at.current * at.current;
    return loss < 0.6 ? -loss : -0.6;  // the series means nothing further out
  }
  static constexpr AxisTermKind kind{.info = &info, .motor = motor};
};

}  // namespace invar::physics
