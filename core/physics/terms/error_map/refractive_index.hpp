// Refractive index: the laser wavelength goes with air pressure.
// Equation: error = coefficient (pressure - reference_pressure) position
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/error_map_hooks.hpp"

namespace invar::physics::error_map {

struct RefractiveIndex {
  static constexpr TermInfo info{
      .name = "refractive_index",
      .plant = Plant::error_map,
      .site = "measurement",
      .depends_on = {"pressure", "position"},
      .parameters =
          {{{"coefficient",
             "1/hPa",
             {-1e-5, 1e-5},
             Role::amplitude,
             {2.7e-7},
             "relative length per pressure"},
            {"reference_pressure", "hPa", {500.0, 1200.0}, Role::shape, {1013.25}, "where it reads right"}}},
      .description =
          "The wavelength of an interferometer is shorter in denser air: without correction it counts "
          "more of them and reads longer at higher pressure.",
      .source = "Edlen 1966, Birch and Downs, Metrologia 30 (1993): about 2.7e-7 per hPa",
      .needs = "pressure"};
  static double error(const MapPoint& at, const double* p) {
    return p[0] * (at.pressure - p[1]) * at.position;
  }
  static constexpr ErrorMapTermKind kind{.info = &info, .error = error};
};

}  // namespace invar::physics::error_map
