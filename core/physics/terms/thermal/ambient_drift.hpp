// Ambient drift: the air about the machine warms while nobody measures it.
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
      .parameters = {{{"rate", "K/s", {-0.1, 0.1}, Role::amplitude, {1e-4}, "from time zero on"}}},
      .description =
          "The air at the node warms or cools steadily against the ambient temperature of the model.",
      .source = "T_amb + rate t"};
  static double ambient(double time, const double* p) { return p[0] * time; }
  static constexpr ThermalTermKind kind{.info = &info, .ambient = ambient};
};

}  // namespace invar::physics
