// Lens distortion: the lens stretches or shrinks the corners of the image.
// Equation: shift [px] = k1 (image_x^2 + image_y^2) (image_x, image_y)
#pragma once

#include <cmath>

#include "core/physics/droplet_hooks.hpp"

namespace invar::physics::droplet {

struct LensDistortion {
  static constexpr TermInfo info{
      .name = "lens_distortion",
      .plant = Plant::droplet,
      .site = "camera",
      .depends_on = {"image"},
      .parameters = {{{"k1", "1/px2", {-1e-5, 1e-5}, Role::amplitude, {1e-8}, "radial distortion"}}},
      .description = "The scale of the camera changes with the distance from the image centre.",
      .source = "Brown 1971, first radial term: k1 r^2 times the image point",
      .needs = "image_x"};
  static void apply(Droplet& d, const double* p) {
    const double stretch = p[0] * (d.image_x * d.image_x + d.image_y * d.image_y);
    d.shift_x += stretch * d.image_x, d.shift_y += stretch * d.image_y;
  }
  static constexpr DropletTermKind kind{.info = &info, .apply = apply};
};

}  // namespace invar::physics::droplet
