// Hysteresis: the reading stands still after a reversal until a gap is crossed.
// Equation: the reading stays within x - width/2 .. x + width/2 and moves only at these limits
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/sensor_hooks.hpp"

namespace invar::physics::sensor {

struct Hysteresis {
  static constexpr TermInfo info{
      .name = "hysteresis",
      .plant = Plant::sensor,
      .site = "measurement",
      .depends_on = {"direction", "history"},
      .parameters = {{{"width", "m", {0.0, 1e-2}, Role::amplitude, {1e-6}, "the whole gap"}}},
      .description =
          "A coupling with play or a sticking head: after a reversal the reading comes late by the width.",
      .source = "play operator: y stays within x - width/2 .. x + width/2",
      .instrument = Instrument::counting};
  static constexpr SensorTermKind kind{.info = &info, .plays = true};
};

}  // namespace invar::physics::sensor
