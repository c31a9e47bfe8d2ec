// Periodic error: the position error repeats along the way.
// Equation: error = amplitude sin(2 pi position / pitch + phase)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/error_map_hooks.hpp"

namespace invar::physics::error_map {

struct PeriodicError {
  static constexpr TermInfo info{
      .name = "periodic_error",
      .plant = Plant::error_map,
      .site = "kinematic",
      .depends_on = {"position"},
      .parameters = {{{"amplitude", "m", {0.0, 1e-2}, Role::amplitude, {3e-7}, "size"},
                      {"pitch", "m", {1e-5, 10.0}, Role::shape, {0.02}, "length of a period"},
                      {"phase", "rad", {-7.0, 7.0}, Role::phase, {0.0}, "phase at position zero"}}},
      .description = "A screw, a gear or a scale errs once a turn or once a division.",
      .source = "ISO 230-2; amplitude sin(2 pi position / pitch + phase)"};
  static double error(const MapPoint& at, const double* p) {
    return p[0] * std::sin(2.0 * std::numbers::pi * at.position / p[1] + p[2]);
  }
  static constexpr ErrorMapTermKind kind{.info = &info, .error = error};
};

}  // namespace invar::physics::error_map
