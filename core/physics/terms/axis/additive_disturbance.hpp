// Additive disturbance: something adds to the current between controller and motor.
// Equation: current = u + offset + amplitude sin(2 pi frequency t + phase) from onset on; squareness blends to sign(sin)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct AdditiveDisturbance {
  static constexpr TermInfo info{
      .name = "additive_disturbance",
      .plant = Plant::axis,
      .site = "actuator",
      .depends_on = {"time"},
      .parameters =
          {{{"amplitude", "A", {0.0, 10.0}, Role::amplitude, {0.01}, "size"},
            {"frequency", "Hz", {0.02, 500.0}, Role::shape, {50.0}, "repetitions per second"},
            {"phase", "rad", {-7.0, 7.0}, Role::phase, {0.0}, "phase at time zero"},
            {"squareness", "1", {0.0, 1.0}, Role::shape, {0.0}, "0: a sine, 1: a square wave"},
            {"onset", "s", {-1e12, 1e12}, Role::reference, {-1e9}, "when it begins"},
            {"offset", "A", {-1e6, 1e6}, Role::reference, {0.0}, "about which it swings: pulses one way"}}},
      .description = "Hum or switching noise is picked up on the way from the controller to the motor.",
      .source = "u + amplitude sin(2 pi frequency t + phase), or the sign of that, + offset"};
  /// The integral of a square wave over its angle: up for half a turn and down again.
  static double triangle(double angle) { return std::abs(std::remainder(angle, 2.0 * std::numbers::pi)); }
  static double command(double u, double time, double step, const double* p) {
    if (time < p[4]) return u;
    const double half = std::numbers::pi * p[1] * step,
                 middle = 2.0 * std::numbers::pi * p[1] * (time + 0.5 * step) + p[2];
    const double sine = std::sin(middle) * (half > 0.0 ? std::sin(half) / half : 1.0);
    const double square = half > 0.0 ? (triangle(middle + half) - triangle(middle - half)) / (2.0 * half)
                                     : std::copysign(1.0, std::sin(middle));
    return u + p[5] + p[0] * ((1.0 - p[3]) * sine + p[3] * square);
  }
  static constexpr AxisTermKind kind{.info = &info, .command = command};
};

}  // namespace invar::physics
