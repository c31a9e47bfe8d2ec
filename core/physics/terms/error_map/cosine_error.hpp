// Cosine error: the measuring axis is not parallel to the motion.
// Equation: error = -position angle^2 / 2
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/error_map_hooks.hpp"

namespace invar::physics::error_map {

struct CosineError {
  static constexpr TermInfo info{
      .name = "cosine_error",
      .plant = Plant::error_map,
      .site = "measurement",
      .depends_on = {"position"},
      .parameters = {{{"angle", "rad", {0.0, 0.2}, Role::amplitude, {1e-3}, "between beam and motion"}}},
      .description = "A beam or scale at an angle to the motion reads shorter than the way travelled.",
      .source = "ISO 230-1: -position angle^2 / 2"};
  static double error(const MapPoint& at, const double* p) { return -0.5 * p[0] * p[0] * at.position; }
  static constexpr ErrorMapTermKind kind{.info = &info, .error = error};
};

}  // namespace invar::physics::error_map
