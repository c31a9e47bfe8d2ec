// Gain droop: the instrument reads less at speed.
// Equation: reading = x (1 - coefficient |velocity|)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/sensor_hooks.hpp"

namespace invar::physics::sensor {

struct GainDroop {
  static constexpr TermInfo info{
      .name = "gain_droop",
      .plant = Plant::sensor,
      .site = "measurement",
      .depends_on = {"velocity", "speed"},
      .parameters =
          {{{"coefficient", "s/m", {0.0, 100.0}, Role::amplitude, {0.02}, "relative loss per speed"}}},
      .description =
          "The signal falls with speed (bandwidth, field, eddy currents): the reading is too small when "
          "fast.",
      .source = "y = x (1 - coefficient |velocity|)",
      .instrument = Instrument::analogue};
  static double reading(const SensorPoint& at, const double* p) {
    return -p[0] * std::abs(at.velocity) * at.value;
  }
  static constexpr SensorTermKind kind{.info = &info, .reading = reading};
};

}  // namespace invar::physics::sensor
