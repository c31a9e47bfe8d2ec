// Pressure dependence: more pressure, faster drops.
// Equation: speed = nominal speed (pressure / reference_pressure)^exponent
#pragma once

#include <cmath>

#include "core/physics/droplet_hooks.hpp"

namespace invar::physics::droplet {

struct PressureDependence {
  static constexpr TermInfo info{
      .name = "pressure_dependence",
      .plant = Plant::droplet,
      .site = "valve",
      .depends_on = {"pressure", "velocity", "height"},
      .parameters =
          {{{"exponent", "1", {0.0, 3.0}, Role::amplitude, {0.5}, "exponent of the pressure in the speed"},
            {"reference_pressure",
             "Pa",
             {1.0, 1e8},
             Role::reference,
             {1e5},
             "at which the nominal speed holds"}}},
      .description = "The drop leaves faster under higher pressure, so it flies for less time.",
      .source = "Bernoulli has exponent 1/2: speed (pressure / reference_pressure)^exponent",
      .needs = "pressure"};
  static void apply(Droplet& d, const double* p) {
    if (d.pressure > 0.0) d.speed_factor *= std::pow(d.pressure / p[1], p[0]);
  }
  static constexpr DropletTermKind kind{.info = &info, .apply = apply};
};

}  // namespace invar::physics::droplet
