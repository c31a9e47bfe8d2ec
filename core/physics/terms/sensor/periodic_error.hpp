// Periodic error: the reading errs with the period of the scale.
// Equation: reading = x + amplitude sin(2 pi position / pitch + phase)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/sensor_hooks.hpp"

namespace invar::physics::sensor {

struct PeriodicError {
  static constexpr TermInfo info{
      .name = "periodic_error",
      .plant = Plant::sensor,
      .site = "measurement",
      .depends_on = {"position"},
      .parameters = {{{"amplitude", "m", {0.0, 1e-2}, Role::amplitude, {5e-7}, "size"},
                      {"pitch", "m", {1e-6, 1.0}, Role::shape, {2e-3}, "period of the scale or tape"},
                      {"phase", "rad", {-7.0, 7.0}, Role::phase, {0.0}, "phase at position zero"}}},
      .description = "Interpolation between the lines of a scale is not perfect.",
      .source = "Heydemann, Applied Optics 20 (1981)",
      .instrument = Instrument::counting};
  static double reading(const SensorPoint& at, const double* p) {
    return p[0] * std::sin(2.0 * std::numbers::pi * at.position / p[1] + p[2]);
  }
  static constexpr SensorTermKind kind{.info = &info, .reading = reading};
};

}  // namespace invar::physics::sensor
