// Eddy current brake: a force against the motion that is largest at one speed and falls beyond it.
// Equation: F = -2 peak (v / v_peak) / (1 + (v / v_peak)^2)
#pragma once

#include <core/physics/axis_hooks.hpp>

struct EddyCurrentBrake {
  static constexpr invar::physics::TermInfo info{
      .name = "eddy_current_brake",
      .plant = invar::physics::Plant::axis,
      .site = "force",
      .depends_on = {"velocity"},
      .parameters = {{{"peak", "N", {0.0, 1e6}, invar::physics::Role::amplitude, {1.0}, "largest force"},
                      {"peak_speed",
                       "m/s",
                       {1e-3, 100.0},
                       invar::physics::Role::shape,
                       {0.1},
                       "speed of the largest force"}}},
      .description = "A plate of metal that moves through the field of magnets.",
      .source = "Wouterse, IEE Proceedings B 138 (1991)"};
  static double force(const invar::physics::AxisPoint& at, const double* p) {
    const double speed = at.velocity / p[1];
    return -2.0 * p[0] * speed / (1.0 + speed * speed);
  }
  static constexpr invar::physics::AxisTermKind kind{.info = &info, .force = force};
};
