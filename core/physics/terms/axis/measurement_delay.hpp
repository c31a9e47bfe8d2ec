// Measurement delay: the encoder value is old.
// Equation: reading(t) = position(t - delay)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"
#include "core/physics/experiments.hpp"

namespace invar::physics {

struct MeasurementDelay {
  static constexpr TermInfo info{
      .name = "measurement_delay",
      .plant = Plant::axis,
      .site = "measurement",
      .depends_on = {"velocity", "frequency", "acceleration", "history"},
      .parameters = {{{"delay", "s", {0.0, 0.05}, Role::amplitude, {2e-4}, "age of the value"}}},
      .description =
          "Interpolation electronics and serial transfer take time: the controller sees where the carriage "
          "was.",
      .source = "y(t) = x(t - delay)",
      .lateness = Lateness::delay,
      .told_apart = {{{"amplifier_lag", experiments::quick}}}};
  static constexpr AxisTermKind kind{.info = &info, .memory = AxisMemory::measurement_delay};
};

}  // namespace invar::physics
