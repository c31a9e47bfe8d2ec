// Radiation: heat lost with the fourth power of the temperature.
// Equation: P = -coefficient (T^4 - T_amb^4), T in kelvin
#pragma once

#include <cmath>

#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

struct Radiation {
  static constexpr TermInfo info{
      .name = "radiation",
      .plant = Plant::thermal,
      .site = "loss",
      .depends_on = {"temperature"},
      .parameters = {{{"coefficient",
                       "W/K4",
                       {0.0, 1e-5},
                       Role::amplitude,
                       {2e-9},
                       "emissivity x area x Stefan-Boltzmann"}}},
      .description =
          "A hot surface radiates to the walls: the loss grows faster than the temperature difference.",
      .source = "Stefan-Boltzmann: P = coefficient (T^4 - T_amb^4), kelvin"};
  static double heat(const ThermalPoint& at, const double* p) {
    const double a = at.temperature + 273.15, b = at.ambient + 273.15;
    return -p[0] * (a * a * a * a - b * b * b * b);
  }
  static constexpr ThermalTermKind kind{.info = &info, .heat = heat};
};

}  // namespace invar::physics
