// Sag: guideway or portal bend smoothly over the travel.
// Equation: error = -depth 4 s (1 - s), s the share of the travel
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/error_map_hooks.hpp"

namespace invar::physics::error_map {

struct Sag {
  static constexpr TermInfo info{
      .name = "sag",
      .plant = Plant::error_map,
      .site = "kinematic",
      .depends_on = {"position"},
      .parameters = {{{"depth", "m", {-1e-2, 1e-2}, Role::amplitude, {5e-7}, "at the middle of the travel"}}},
      .description =
          "Load or an uneven foundation bends the guideway: a smooth error, largest in the middle.",
      .source = "beam on two supports, parabola: -depth 4 s (1 - s), s the share of the travel"};
  static double error(const MapPoint& at, const double* p) {
    const double s = (at.position - at.first) / (at.last - at.first);
    return -p[0] * 4.0 * s * (1.0 - s);
  }
  static constexpr ErrorMapTermKind kind{.info = &info, .error = error};
};

}  // namespace invar::physics::error_map
