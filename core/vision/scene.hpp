// Content of a rendered picture: drops, scratches, light, lens, noise.
#pragma once

#include <cstdint>
#include <vector>

namespace invar::vision {

/// An ellipse of even brightness in *ideal* (undistorted) pixel coordinates; x right, y down, (0, 0) the centre
/// of the top left pixel.
struct RenderedDisc {
  double x = 0.0, y = 0.0;  // px
  double radius = 10.0;     // px; the circle of equal area
  double axis_ratio = 1.0;  // minor over major axis
  double angle = 0.0;       // rad; of the major axis
  double gradient_x = 0.0;  // change of brightness across the drop, share of its contrast per radius
  double gradient_y = 0.0;
  double glare = 0.0;  // a reflection of the lamp inside the drop: its height, share of the contrast
};

struct RenderedScratch {
  double x0 = 0.0, y0 = 0.0, x1 = 0.0, y1 = 0.0;  // px
  double width = 2.0;                             // px
  double strength = 0.5;                          // share of the drops' contrast
};

struct Scene {
  int width = 1200;          // px
  int height = 800;          // px
  double background = 40.0;  // grey levels of 8 bits
  double foreground = 200.0;
  double blur = 1.0;           // px, standard deviation of the optics' blur
  double noise = 2.0;          // grey levels, standard deviation
  double light_slope_x = 0.0;  // share of the light from the left edge to the right one
  double light_slope_y = 0.0;  // from the top edge to the bottom
  double vignetting = 0.0;     // share of the light lost in the corners
  double clutter = 0.0;        // grey levels, standard deviation of slow blotches of the substrate
  double distortion = 0.0;  // ideal = centre + (seen - centre) * (1 + distortion * r^2), r in half diagonals
  int jpeg_quality = 0;     // 0: no compression
  int dust = 0;             // how many specks
  std::vector<RenderedDisc> discs;
  std::vector<RenderedScratch> scratches;
  std::uint64_t seed = 1;  // of noise, clutter and dust
};

}  // namespace invar::vision
