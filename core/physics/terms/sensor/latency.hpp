// Latency: the instrument shows an old value.
// Equation: reading(t) = x(t - delay)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/sensor_hooks.hpp"

namespace invar::physics::sensor {

struct Latency {
  static constexpr TermInfo info{
      .name = "latency",
      .plant = Plant::sensor,
      .site = "measurement",
      .depends_on = {"velocity", "acceleration"},
      .parameters = {{{"delay", "s", {0.0, 0.05}, Role::amplitude, {5e-6}, "age of the value"}}},
      .description = "Interpolation and transfer take time: at speed the reading trails the truth.",
      .source = "y(t) = x(t - delay)"};
  static constexpr SensorTermKind kind{.info = &info, .delays = true};
};

}  // namespace invar::physics::sensor
