// Periodic disturbance: a force that repeats in time.
// Equation: F = amplitude sin(2 pi frequency t + phase) from onset on
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct PeriodicDisturbance {
  static constexpr TermInfo info{
      .name = "periodic_disturbance",
      .plant = Plant::axis,
      .site = "disturbance",
      .depends_on = {"time"},
      .parameters = {{{"amplitude", "N", {0.0, 1000.0}, Role::amplitude, {0.2}, "size"},
                      {"frequency", "Hz", {0.02, 500.0}, Role::shape, {25.0}, "repetitions per second"},
                      {"phase", "rad", {-7.0, 7.0}, Role::phase, {0.0}, "phase at time zero"},
                      {"onset", "s", {-1e12, 1e12}, Role::reference, {-1e9}, "when it begins"}}},
      .description = "A pump, a fan or a neighbouring machine shakes the axis in its own rhythm.",
      .source = "F = amplitude sin(2 pi frequency t + phase)",
      .told_apart = {
          {{"force_ripple",
            "run at another speed: a ripple along the way keeps its pitch, a disturbance in time "
            "its frequency"},
           {"additive_disturbance",
            "record with the motor switched off and the carriage free: a force shakes it still"}}}};
  static double force(const AxisPoint& at, const double* p) {
    if (at.time < p[3]) return 0.0;
    return p[0] * std::sin(2.0 * std::numbers::pi * p[1] * at.time + p[2]);
  }
  static constexpr AxisTermKind kind{.info = &info, .force = force};
};

}  // namespace invar::physics
