// The outline of one drop to a hundredth of a pixel: edges along rays, a smooth closed curve through them.
#pragma once

#include <array>

#include "core/vision/edge_filter.hpp"

namespace cv {
class Mat;
}  // namespace cv

namespace invar::vision {

/// r(theta) = radius + cos2 cos(2 theta) + sin2 sin(2 theta) about the centre: a circle, or nearly an ellipse.
struct Shape {
  double x = 0.0, y = 0.0;        // px; centre of the drop
  double radius = 0.0;            // px; mean over the angle
  double cos2 = 0.0, sin2 = 0.0;  // px
  [[nodiscard]] double equal_area_radius() const;
  [[nodiscard]] double axis_ratio() const;  // minor over major
};

/// The directions in which a drop's edge is sought. Real-time callers keep one and use it again.
struct Rays {
  static constexpr int most = 256;
  int count = 64;
  std::array<bool, most> open{};     // false: a neighbour or the border hides the edge there
  std::array<float, most> offset{};  // px; the edge found, outward from the shape it was sought at
  std::array<float, most> weight{};  // 0..1; 0: closed, no edge there, or one that is not the drop's

  /// As many rays as the drop's size deserves, all open.
  void choose(double radius);
  /// Closes rays whose edge region comes nearer than `guard` to a disc.
  void close(const Shape& shape, double reach, double x, double y, double radius, double guard);
};

/// The direction of ray i [rad], from x towards y.
double ray_angle(const Rays& rays, int i);

struct OutlineFit {
  Shape shape;  // before correction of the blur's pull, see `blur`
  double blur =
      0.0;  // px, standard deviation of the edge's profile; it pulls the edge inward by blur^2/(2 radius)
  double contrast = 0.0;  // grey levels, inside minus outside
  double residual = 0.0;  // px, robust RMS of the edges about the shape
  double support = 0.0;   // share of the open rays that agree with the shape
  double coverage = 0.0;  // share of the whole outline that was seen and agrees
  double moved = 0.0;     // px, from the shape that was given
  double sigma = 0.0;     // px, standard deviation of each coordinate of the centre, from the residuals
  bool valid = false;     // false: nothing else above counts
};

/// Finds the strongest edge of the right sign on each ray within `reach` px of the shape. Good to about 0.2 px; needs
/// no knowledge of blur or levels. `image`: CV_8UC1; `polarity` as in Detection.
OutlineFit seek_outline(const cv::Mat& image, const Shape& shape, int polarity, double reach, Rays& rays);

/// Places each ray's edge by least squares with the blurred step of `filter` and free levels on both sides. Slopes of the
/// brightness inside and outside are common to the drop (constant and, as far as beyond chance, first harmonic
/// over the angle), so shading shifts nothing. Start within about one blur of the edge.
OutlineFit refine_outline(const cv::Mat& image, const Shape& shape, int polarity, const EdgeFilter& filter,
                          Rays& rays);

}  // namespace invar::vision
