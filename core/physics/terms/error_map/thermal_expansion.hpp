// Thermal expansion: scale and machine grow with temperature.
// Equation: error = coefficient (T - T_ref) position
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/error_map_hooks.hpp"

namespace invar::physics::error_map {

struct ThermalExpansion {
  static constexpr TermInfo info{
      .name = "thermal_expansion",
      .plant = Plant::error_map,
      .site = "thermal",
      .depends_on = {"temperature", "position"},
      .parameters =
          {{{"coefficient", "1/K", {-1e-3, 1e-3}, Role::amplitude, {1e-6}, "scale against work piece"}}},
      .description =
          "Scale and table expand unlike each other: the error grows with the position and with the "
          "temperature above the reference.",
      .source = "ISO 230-3: coefficient (T - T_ref) position",
      .needs = "temperature",
      .stands_for = "expansion"};
  static double error(const MapPoint& at, const double* p) { return p[0] * at.warmth * at.position; }
  static constexpr ErrorMapTermKind kind{.info = &info, .error = error};
};

}  // namespace invar::physics::error_map
