// Heating rate lag: the scale follows the thermometer late.
// Equation: expansion acts with T_scale, dT_scale/dt = (T - T_scale) / time_constant
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/error_map_hooks.hpp"

namespace invar::physics::error_map {

struct HeatingRateLag {
  static constexpr TermInfo info{
      .name = "heating_rate_lag",
      .plant = Plant::error_map,
      .site = "thermal",
      .depends_on = {"temperature", "time", "history"},
      .parameters = {{{"time_constant",
                       "s",
                       {0.0, 1e6},
                       Role::amplitude,
                       {300.0, 30.0, 3000.0},
                       "time constant of the scale behind the sensor"}}},
      .description =
          "The thermometer sits elsewhere than the scale: while the machine warms, the expansion that the "
          "thermometer foretells comes later.",
      .source = "dT_scale/dt = (T - T_scale) / time_constant, in the expansion of the model",
      .needs = "temperature",
      .acts_in = "expansion"};
  static constexpr ErrorMapTermKind kind{.info = &info, .delays_warmth = true};
};

}  // namespace invar::physics::error_map
