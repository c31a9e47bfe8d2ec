// Stribeck friction: dry friction that is larger at low speed than at high speed.
// Equation: F = -(coulomb + (static - coulomb) exp(-(v / velocity)^2)) sign(v)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"
#include "core/physics/experiments.hpp"

namespace invar::physics {

struct StribeckFriction {
  static constexpr TermInfo info{
      .name = "stribeck_friction",
      .plant = Plant::axis,
      .site = "force",
      .depends_on = {"velocity", "direction"},
      .parameters = {{{"coulomb", "N", {0.0, 500.0}, Role::amplitude, {0.5}, "friction force at speed"},
                      {"static", "N", {0.0, 1000.0}, Role::amplitude, {1.0}, "friction force at rest"},
                      {"velocity",
                       "m/s",
                       {3e-4, 0.3},
                       Role::shape,
                       {0.008, 0.03, 0.002},
                       "speed at which the excess has fallen to 1/e"}}},
      .description =
          "Dry friction that falls from its value at rest to the Coulomb level as a lubricant film "
          "builds up.",
      .source = "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994), eq. 4, exponent 2",
      .is_friction = true,
      .falls_with_speed = true,
      .told_apart = {
          {{"constant_force", experiments::both_ways}, {"presliding_friction", experiments::creep}}}};
  static double friction(double speed, const double* p) {
    const double s = speed / p[2];
    return p[0] + (p[1] - p[0]) * std::exp(-s * s);
  }
  static constexpr AxisTermKind kind{.info = &info, .friction = friction};
};

}  // namespace invar::physics
