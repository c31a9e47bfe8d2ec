// Ambient drift: the air about the machine warms while nobody measures it.
// Equation: T_amb += rate over (1 - exp(-settling t)) / (1 - exp(-settling over)); settling 0: T_amb += rate t
#pragma once

#include <cmath>

#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

struct AmbientDrift {
  static constexpr TermInfo info{
      .name = "ambient_drift",
      .plant = Plant::thermal,
      .site = "source",
      .depends_on = {"time", "ambient"},
      .parameters = {{{"rate", "K/s", {-0.1, 0.1}, Role::amplitude, {1e-4}, "from time zero on"},
                      {"settling", "1/s", {0.0, 1.0}, Role::amplitude, {1e-3}, "0: it goes on as it began"},
                      {"over", "s", {0.0, 1e9}, Role::reference, {0.0}, "the rate is the mean until then"}}},
      .description =
          "The air at the node warms or cools against the ambient temperature of the model: steadily, or "
          "towards "
          "where a room settles.",
      .source =
          "T_amb + rate t; settling: T_amb + rate over (1 - exp(-settling t)) / (1 - exp(-settling over))"};
  static double ambient(double time, const double* p) {
    if (!(p[1] > 0.0)) return p[0] * time;
    const double reached = p[2] > 0.0 ? -std::expm1(-p[1] * p[2]) / p[2] : p[1];
    return p[0] * -std::expm1(-p[1] * time) / reached;
  }
  static constexpr ThermalTermKind kind{.info = &info, .ambient = ambient};
};

}  // namespace invar::physics
