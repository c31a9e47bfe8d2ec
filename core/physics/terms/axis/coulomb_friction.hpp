// Coulomb friction: a force of constant size against the motion.
// Equation: F = -level sign(v); at standstill up to level against the other forces
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"
#include "core/physics/experiments.hpp"

namespace invar::physics {

struct CoulombFriction {
  static constexpr TermInfo info{
      .name = "coulomb_friction",
      .plant = Plant::axis,
      .site = "force",
      .depends_on = {"direction", "velocity"},
      .parameters = {{{"level", "N", {0.0, 500.0}, Role::amplitude, {0.5}, "friction force while moving"}}},
      .description =
          "Dry friction of guideway and seals: of constant size, against the motion; it also holds the "
          "carriage at rest up to that size.",
      .source = "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994), eq. 1",
      .is_friction = true,
      .told_apart = {
          {{"constant_force", experiments::both_ways}, {"presliding_friction", experiments::creep}}}};
  static double friction(double /*speed*/, const double* p) { return p[0]; }
  static constexpr AxisTermKind kind{.info = &info, .friction = friction};
};

}  // namespace invar::physics
