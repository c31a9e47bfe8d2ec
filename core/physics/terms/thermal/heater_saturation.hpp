// Heater saturation: above some power the heater gives no more.
// Equation: P = min(P commanded, power)
#pragma once

#include <cmath>

#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

struct HeaterSaturation {
  static constexpr TermInfo info{
      .name = "heater_saturation",
      .plant = Plant::thermal,
      .site = "source",
      .depends_on = {"power"},
      // Stored as the power at which it clips; a clip that is never reached has no effect.
      .parameters = {{{"power", "W", {1e-6, 1e7}, Role::shape, {1e6}, "the most it gives"}}},
      .description =
          "The supply or the controller limits the power: what is commanded above it does not arrive.",
      .source = "min(P, power)"};
  static double heater(double power, const double* p) { return power < p[0] ? power : p[0]; }
  static constexpr ThermalTermKind kind{.info = &info, .heater = heater};
};

}  // namespace invar::physics
