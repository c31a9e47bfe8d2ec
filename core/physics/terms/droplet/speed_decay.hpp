// Speed decay: the drops leave the nozzle more slowly as time goes on.
// Equation: speed = nominal speed exp(-rate t)
#pragma once

#include <cmath>

#include "core/physics/droplet_hooks.hpp"

namespace invar::physics::droplet {

struct SpeedDecay {
  static constexpr TermInfo info{
      .name = "speed_decay",
      .plant = Plant::droplet,
      .site = "flight",
      .depends_on = {"time", "velocity", "height"},
      .parameters =
          {{{"rate", "1/s", {0.0, 1.0}, Role::amplitude, {3e-4}, "relative loss of speed per second"}}},
      .description = "The nozzle clogs or the reservoir empties: speed falls with time, so drops fly longer.",
      .source = "speed exp(-rate t)"};
  static void apply(Droplet& d, const double* p) { d.speed_factor *= std::exp(-p[0] * d.time); }
  static constexpr DropletTermKind kind{.info = &info, .apply = apply};
};

}  // namespace invar::physics::droplet
