// Speed-dependent convection: the loss grows while the stage moves.
// Equation: P = -coefficient |speed| (|speed| / at_speed)^(exponent - 1) (T - T_amb)
#pragma once

#include <cmath>

#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

struct SpeedDependentConvection {
  static constexpr TermInfo info{
      .name = "speed_dependent_convection",
      .plant = Plant::thermal,
      .site = "loss",
      .depends_on = {"speed"},
      .parameters =
          {{{"coefficient", "W s/(K m)", {0.0, 1e4}, Role::amplitude, {0.3}, "loss added per speed"},
            {"exponent", "1", {0.3, 2.0}, Role::shape, {1.0}, "exponent of the speed"},
            {"at_speed", "m/s", {0.0, 1e4}, Role::reference, {0.0}, "at which the coefficient is meant"}}},
      .description = "The moving stage drives air along its surfaces, which carries more heat away.",
      .source =
          "forced convection: P = coefficient |speed| (|speed| / at_speed)^(exponent - 1) (T - T_amb). The "
          "exponent is 0.5 in "
          "laminar and 0.8 in turbulent flow (Incropera, Fundamentals of Heat and Mass Transfer, 7.2). It is "
          "1 "
          "over a small range",
      .needs = "speed"};
  static double heat(const ThermalPoint& at, const double* p) {
    const double speed = std::abs(at.speed), meant = p[2] > 0.0 ? p[2] : 1.0;
    const double bent = speed > 0.0 && p[1] > 0.0 && p[1] != 1.0 ? std::pow(speed / meant, p[1] - 1.0) : 1.0;
    return -p[0] * speed * bent * (at.temperature - at.ambient);
  }
  static constexpr ThermalTermKind kind{.info = &info, .heat = heat};
};

}  // namespace invar::physics
