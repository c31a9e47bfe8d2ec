// Bias: the instrument does not read zero at zero.
// Equation: reading = x + value
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/sensor_hooks.hpp"

namespace invar::physics::sensor {

struct Bias {
  static constexpr TermInfo info{
      .name = "bias",
      .plant = Plant::sensor,
      .site = "measurement",
      .depends_on = {},
      .parameters =
          {{{"value", "*", {-1e3, 1e3}, Role::amplitude, {1e-6}, "added to the reading, in its unit"}}},
      .description = "Offset of an amplifier or of a zero point.",
      .source = "y = x + value",
      .is_steady = true};
  static double reading(const SensorPoint& /*at*/, const double* p) { return p[0]; }
  static constexpr SensorTermKind kind{.info = &info, .reading = reading};
};

}  // namespace invar::physics::sensor
