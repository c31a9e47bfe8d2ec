// Speed-dependent convection: the loss grows while the stage moves.
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
          {{{"coefficient", "W s/(K m)", {0.0, 1e4}, Role::amplitude, {0.3}, "loss added per speed"}}},
      .description = "The moving stage drives air along its surfaces, which carries more heat away.",
      .source = "forced convection, linear in speed over a small range: P = coefficient |speed| (T - T_amb)"};
  static double heat(const ThermalPoint& at, const double* p) {
    return -p[0] * std::abs(at.speed) * (at.temperature - at.ambient);
  }
  static constexpr ThermalTermKind kind{.info = &info, .heat = heat};
};

}  // namespace invar::physics
