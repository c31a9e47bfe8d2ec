// Abbe offset: the point measured lies beside the scale and the carriage tilts.
// Equation: error = offset (angle + angle_change (s - 1/2) + angle_bow (4 s (1 - s) - 1) + angle_twist u (5 u^2 - 3) / 2), s the share of the travel, u = 2 s - 1
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/error_map_hooks.hpp"

namespace invar::physics::error_map {

struct AbbeOffset {
  static constexpr TermInfo info{
      .name = "abbe_offset",
      .plant = Plant::error_map,
      .site = "kinematic",
      .depends_on = {"offset", "position"},
      .parameters =
          {{{"angle", "rad", {-0.1, 0.1}, Role::amplitude, {5e-6}, "tilt at the middle of the travel"},
            {"angle_change",
             "rad",
             {-0.1, 0.1},
             Role::amplitude,
             {5e-6},
             "from one end of the travel to the other"},
            {"angle_bow", "rad", {-0.1, 0.1}, Role::amplitude, {5e-6}, "middle against the ends"},
            {"angle_twist",
             "rad",
             {-0.1, 0.1},
             Role::amplitude,
             {5e-6},
             "one way in the first half, the other in the second"}}},
      .description =
          "The carriage pitches or yaws; beside the scale that moves the point by offset times angle.",
      .source = "Abbe 1890; ISO 230-1: error = offset angle(position), the angle a cubic along the way",
      .needs_varied = "offset"};  // beside one offset a tilt is any course over the position
  static double error(const MapPoint& at, const double* p) {
    const double s = (at.position - at.first) / (at.last - at.first);
    const double u = 2.0 * s - 1.0;
    return at.offset * (p[0] + p[1] * (s - 0.5) + p[2] * (4.0 * s * (1.0 - s) - 1.0) +
                        p[3] * 0.5 * u * (5.0 * u * u - 3.0));
  }
  static constexpr ErrorMapTermKind kind{.info = &info, .error = error};
};

}  // namespace invar::physics::error_map
