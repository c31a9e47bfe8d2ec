// Flexible mode: a part on the carriage swings on its mounting.
// Equation: m2 z'' = -c (z' - x') - k (z - x), m2 = mass_share mass, k = m2 (2 pi frequency)^2, c = 2 damping_ratio sqrt(k m2)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"

namespace invar::physics {

struct FlexibleMode {
  static constexpr TermInfo info{
      .name = "flexible_mode",
      .plant = Plant::axis,
      .site = "structure",
      .depends_on = {"frequency", "acceleration", "history"},
      .parameters =
          {{{"mass_share", "1", {0.0, 0.9}, Role::amplitude, {0.05}, "share of the moved mass that swings"},
            {"frequency",
             "Hz",
             {2.0, 400.0},
             Role::shape,
             {60.0, 25.0, 120.0, 220.0},
             "natural frequency of the part on a carriage held fast"},
            {"damping_ratio", "1", {1e-4, 0.9}, Role::shape, {0.03}, "damping ratio of that mode"}}},
      .description =
          "A part of the moved mass hangs on the carriage by a spring (mounting, cable carrier, tall "
          "structure): it follows late and rings.",
      .source = "two-mass oscillator, e.g. Dresig, Holzweissig, Dynamics of Machinery (2010), ch. 4"};
  static constexpr AxisTermKind kind{.info = &info, .memory = AxisMemory::flexible_mode};
};

}  // namespace invar::physics
