// Encoder periodic error: the reading errs with the period of the scale.
// Equation: reading = position + amplitude sin(2 pi position / pitch + phase)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct EncoderPeriodicError {
  static constexpr TermInfo info{
      .name = "encoder_periodic_error",
      .plant = Plant::axis,
      .site = "measurement",
      .depends_on = {"position"},
      .parameters = {{{"amplitude", "m", {0.0, 1e-3}, Role::amplitude, {3e-7}, "size"},
                      {"pitch", "m", {1e-6, 0.5}, Role::shape, {1e-3}, "period of the scale or tape"},
                      {"phase", "rad", {-7.0, 7.0}, Role::phase, {0.0}, "phase at position zero"}}},
      .description =
          "Interpolation between the lines of a scale is not perfect: the reading swings about the truth "
          "once a period.",
      .source = "Heydemann, Applied Optics 20 (1981)"};
  static double reading(double position, const double* p) {
    return p[0] * std::sin(2.0 * std::numbers::pi * position / p[1] + p[2]);
  }
  static constexpr AxisTermKind kind{.info = &info, .reading = reading};
};

}  // namespace invar::physics
