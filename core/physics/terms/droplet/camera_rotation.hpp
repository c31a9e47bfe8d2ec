// Camera rotation: the camera is turned against the axes.
// Equation: shift [px] = angle (-image_y, image_x)
#pragma once

#include <cmath>

#include "core/physics/droplet_hooks.hpp"

namespace invar::physics::droplet {

struct CameraRotation {
  static constexpr TermInfo info{
      .name = "camera_rotation",
      .plant = Plant::droplet,
      .site = "camera",
      .depends_on = {"image"},
      .parameters = {{{"angle", "rad", {-0.5, 0.5}, Role::amplitude, {2e-3}, "counter-clockwise"}}},
      .description = "The image is turned: what lies off its centre is taken for a shift across.",
      .source = "shift = angle (-image_y, image_x)",
      .needs = "image_x"};
  static void apply(Droplet& d, const double* p) {
    d.shift_x -= p[0] * d.image_y, d.shift_y += p[0] * d.image_x;
  }
  static constexpr DropletTermKind kind{.info = &info, .apply = apply};
};

}  // namespace invar::physics::droplet
