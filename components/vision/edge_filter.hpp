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
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, most>
      step;  // samples -> ground, contrast, contrast * offset
  Eigen::Matrix<double, 5, Eigen::Dynamic, 0, 5, most>
      sloped;  // the same and the slopes inside and outside [1/px]
  Eigen::Matrix<double, 4, Eigen::Dynamic, 0, 4, most>
      spread;                        // the same as step and contrast * (change of blur)
  Profile unit, bump, inner, outer;  // S, g, the ramps of slope inside and outside

  // The same in single precision for the loop over rays: rows of `step`, and the profiles.
  std::array<float, most + 1> ground_f{}, height_f{}, shift_f{}, unit_f{}, bump_f{}, inner_f{}, outer_f{};

  /// `half`: at least 3. Set-up only, or once a frame (some microseconds).
  EdgeFilter(double blur, int half);
  /// The half width that a blur wants, within a drop's radius [px].
  static int half_for(double blur, double radius);
};

}  // namespace invar::vision
