// Heat bending: a slide that is warm on one side bows, and the scale on it with the slide.
// Equation: error = depth 4 s (1 - s) (T - T_ref), s the share of the travel
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/error_map_hooks.hpp"

namespace invar::physics::error_map {

struct HeatBending {
  static constexpr TermInfo info{
      .name = "heat_bending",
      .plant = Plant::error_map,
      .site = "thermal",
      .depends_on = {"temperature", "position"},
      .parameters = {{{"depth",
                       "m/K",
                       {-1e-4, 1e-4},
                       Role::amplitude,
                       {1e-7},
                       "at the middle of the travel, per kelvin above the reference"}}},
      .description =
          "A slide heated from one side bends like a bimetal: a smooth error that is largest in the middle "
          "and grows with the temperature above the reference.",
      .source =
          "beam with a temperature gradient, parabola: depth 4 s (1 - s) (T - T_ref), s the share of the "
          "travel"};
  static double error(const MapPoint& at, const double* p) {
    const double s = (at.position - at.first) / (at.last - at.first);
    return p[0] * 4.0 * s * (1.0 - s) * at.warmth;
  }
  static constexpr ErrorMapTermKind kind{.info = &info, .error = error};
};

}  // namespace invar::physics::error_map
