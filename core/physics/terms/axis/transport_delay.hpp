// Transport delay: the motor gets the current late.
// Equation: current(t) = u(t - delay)
#pragma once

#include <cmath>
#include <numbers>

#include "core/physics/axis_hooks.hpp"
#include "core/physics/experiments.hpp"

namespace invar::physics {

struct TransportDelay {
  static constexpr TermInfo info{
      .name = "transport_delay",
      .plant = Plant::axis,
      .site = "actuator",
      .depends_on = {"current", "frequency", "acceleration", "history"},
      .parameters = {{{"delay", "s", {0.0, 0.05}, Role::amplitude, {2e-4}, "dead time before the motor"}}},
      .description =
          "Computation, bus and amplifier take time: the current of one instant acts some time later.",
      .source = "u(t - delay)",
      .lateness = Lateness::delay,
      .told_apart = {{{"measurement_delay",
                       "record the position with a second, direct instrument. Diagnose with its column, "
                       "`current` as an input and no controller. A late motor is found again, a late encoder "
                       "is not"},
                      {"amplifier_lag", experiments::quick}}}};
  static constexpr AxisTermKind kind{.info = &info, .memory = AxisMemory::transport_delay};
};

}  // namespace invar::physics
