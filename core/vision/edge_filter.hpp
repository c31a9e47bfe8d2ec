// Least squares of a blurred step in one dimension, prepared once for a blur.
#pragma once

#include <Eigen/Core>
#include <array>

namespace invar::vision {

/// Samples at k = -half .. half px across an edge at 0, inside for k < 0. Model of a ray:
/// f(k) = ground + contrast * (S(k) + offset * g(k)), S(k) = Phi(-k / blur) the blurred step, g = -dS/dk.
struct EdgeFilter {
  static constexpr int most_half = 15;
  static constexpr int most = 2 * most_half + 1;
  using Profile = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most, 1>;

  double blur;  // px
  int half;     // px
  // In single precision for the loop over rays: the part of a sample in ground, contrast, contrast * offset, and in its product
  // with the two ramps. The sloped step adds the slopes; the spread one adds contrast and contrast * (change of blur).
  enum Row : std::size_t {
    to_ground,
    to_height,
    to_shift,
    to_inner,
    to_outer,
    to_slope_in,
    to_slope_out,
    to_spread_height,
    to_spread_blur,
    rows
  };
  std::array<std::array<float, most>, rows> products{};
  // Part of the ramps themselves in ground, contrast, contrast * offset. The products of the columns 1, S, g with one
  // another, and of the ramps, give the misfit of a ray from its products alone.
  Eigen::Vector3d from_inner, from_outer;
  Eigen::Matrix3d columns;
  double inner_inner = 0.0, inner_outer = 0.0, outer_outer = 0.0;
  Eigen::Vector2d spread_inner, spread_outer;  // what the ramps add to contrast, contrast * (change of blur)

  /// `half`: at least 3. Set-up only, or once a frame (some microseconds).
  EdgeFilter(double blur, int half);
  /// The half width that a blur wants, within a drop's radius [px].
  static int half_for(double blur, double radius);
};

}  // namespace invar::vision
