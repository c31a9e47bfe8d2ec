// Sensor lag: the thermometer follows its node late.
// Equation: dT_sensor/dt = (T - T_sensor) / time_constant
#pragma once

#include <cmath>

#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

struct SensorLag {
  static constexpr TermInfo info{
      .name = "sensor_lag",
      .plant = Plant::thermal,
      .site = "measurement",
      .depends_on = {"history", "temperature", "power", "frequency"},
      .parameters = {{{"time_constant",
                       "s",
                       {0.0, 1e4},
                       Role::amplitude,
                       {2.0},
                       "time constant of the sensor on its place"}}},
      .description =
          "The sensor has a heat capacity and sits behind glue or paste: it shows where the node was.",
      .source = "dT_sensor/dt = (T - T_sensor) / time_constant",
      .lateness = Lateness::lag};
  static constexpr ThermalTermKind kind{.info = &info, .memory = ThermalMemory::sensor_lag};
};

}  // namespace invar::physics
