// Presliding friction: after a reversal the friction builds up like a spring over micrometres.
// Equation: F = -(stiffness z + damping v (1 - z sign(v) stiffness / level)), dz/dt = v (1 - z sign(v) stiffness / level)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"
#include "core/physics/experiments.hpp"

namespace invar::physics {

struct PreslidingFriction {
  static constexpr TermInfo info{
      .name = "presliding_friction",
      .plant = Plant::axis,
      .site = "force",
      .depends_on = {"position", "velocity", "direction", "history"},
      .parameters = {{{"level", "N", {0.0, 500.0}, Role::amplitude, {0.5}, "friction force once sliding"},
                      {"stiffness",
                       "N/m",
                       {0.01, 1e7},
                       Role::shape,
                       {5e4, 1e4, 3e5},
                       "slope of the force just after a reversal"},
                      {"damping",
                       "N s/m",
                       {0.0, 1e5},
                       Role::amplitude,
                       {5.0},
                       "damping of the bristles while they bend"}}},
      .description =
          "Rolling bearings and seals bend before they slide: the friction force follows the way since "
          "the last reversal, with hysteresis, and reaches its level after some level / stiffness.",
      .source =
          "LuGre at constant level; Dahl, AIAA Journal 14 (1976), exponent 1: dF/dx = stiffness (1 - F/level "
          "sign(v))",
      .is_friction = true,
      .springs_first = true,
      .in_proportion = {"stiffness", 1.0},  // they bend as far as before
      .told_apart = {{{"constant_force", experiments::both_ways}}}};
  /// The bristle deflection after moving by `way` from a deflection `z` (both m): the exact solution for one
  /// direction of motion, whatever the speed.
  static double deflection(double z, double way, const double* p) {
    const double most = p[0] / p[1];
    if (!(most > 0.0)) return 0.0;
    const double limit = way >= 0.0 ? most : -most;
    return limit + (z - limit) * std::exp(-std::abs(way) / most);
  }
  /// [N] of bristles bent by z at this speed; their damping fades as they begin to slide.
  static double force(double z, double velocity, const double* p) {
    const double most = p[0] / p[1];
    if (!(most > 0.0)) return 0.0;
    const double bending = 1.0 - (velocity >= 0.0 ? z : -z) / most;
    return p[1] * z + p[2] * velocity * bending;
  }
  static constexpr AxisTermKind kind{.info = &info, .memory = AxisMemory::presliding};
};

}  // namespace invar::physics
