// Actions of a term on one droplet between valve and camera.
#pragma once

#include "core/physics/term.hpp"

namespace invar::physics {

/// One droplet: what is known of it, and what terms change. SI, pressure in Pa, image in px from the image centre.
struct Droplet {
  double time = 0.0, height = 0.0, pressure = 0.0, image_x = 0.0, image_y = 0.0;
  double stage_x = 0.0, stage_y = 0.0;  // [m/s]

  double speed = 1.0;                   // at the nozzle
  double speed_factor = 1.0;            // by which pressure and time change it
  bool carried = false;                 // keeps the velocity of the stage
  double delay = 0.0;                   // [s] of the valve
  double diameter = 0.0;                // [m] 0: the air does not slow it
  double pull_x = 0.0, pull_y = 0.0;    // [m/s2] across the flight
  double shift_x = 0.0, shift_y = 0.0;  // [px] in the image
};

struct DropletTermKind {
  const TermInfo* info = nullptr;
  void (*apply)(Droplet&, const double*) = nullptr;
};

/// Where it lands beside the point below the nozzle at trigger time [m]; slopes are those of the valve's tilt.
struct Landing {
  double x = 0.0, y = 0.0;
};
Landing landing(const Droplet& droplet, double slope_x, double slope_y);

}  // namespace invar::physics
