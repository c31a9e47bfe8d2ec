// Backlash: the error depends on the side from which a point is approached.
// Equation: error = middle + width direction / 2
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/error_map_hooks.hpp"

namespace invar::physics::error_map {

struct Backlash {
  static constexpr TermInfo info{
      .name = "backlash",
      .plant = Plant::error_map,
      .site = "kinematic",
      .depends_on = {"direction"},
      .parameters = {{{"width",
                       "m",
                       {-1e-2, 1e-2},
                       Role::amplitude,
                       {5e-7},
                       "the whole gap: error from + less error from -"},
                      {"middle",
                       "m",
                       {-1e-2, 1e-2},
                       Role::amplitude,
                       {5e-7},
                       "mean of both sides: half the width where the baseline was taken from one side"}}},
      .description =
          "Play or elastic wind-up in the drive: a point reached from below differs from the same point "
          "reached from above.",
      .source = "ISO 230-2, reversal value: middle + width / 2 times the direction",
      .sticks_and_slips = true,
      .needs = "direction"};
  static double error(const MapPoint& at, const double* p) { return 0.5 * p[0] * at.direction + p[1]; }
  static constexpr ErrorMapTermKind kind{.info = &info, .error = error};
};

}  // namespace invar::physics::error_map
