// GeometricPrior: what is expected of error motions before anybody measures; its strengths come from evidence.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/metrology/geometric/geometric_basis.hpp"

namespace invar::metrology {

/// Kinds of error motion that share an amplitude and a length.
enum class MotionKind { positioning = 0, straightness = 1, angle = 2 };
MotionKind kind_of(int motion);

/// Strengths of the prior, by kind. A roughness penalty is no substitute: it leaves what the lines do not see with
/// a huge prior (docs/explanation/geometric.md#estimator).
struct GeometricPrior {
  std::array<double, 3> amplitude{2e-6, 2e-6, 8e-6};  // m, m, rad: sd of the waviness
  std::array<double, 3> length{0.07, 0.07, 0.07};     // m, over which it changes (Matern 5/2)
  /// On top of it what repeats over a few centimetres, as a screw's pitch does. Angles have none: it would move nothing.
  std::array<double, 3> fine_amplitude{3e-7, 2e-7, 0.0};  // m, m, rad
  double fine_length = 0.012;                             // m
  double wave_amplitude = 2e-6;     // m, sd of the cosine and the sine of a periodic error
  double wave_turn = 1.0;           // rad over the travel, sd of its number when first found
  double positioning_slope = 2e-4;  // sd of the scale error of an axis
  double angle_slope = 2.0;         // sd of an angle's linear part over the axis' range, in amplitudes
  double squareness = 5e-3;         // rad, sd
  double expansion = 2e-5;          // 1/K, sd: steel 1.2e-5, aluminium 2.3e-5
  /// Factor on the amplitude of its kind, by error motion: no two axes of a machine are equally good.
  std::array<double, error_motion_count> relative = [] {
    std::array<double, error_motion_count> ones{};
    ones.fill(1.0);
    return ones;
  }();
  /// Factor on the length of its kind, by axis. Rails that bow over their length have waves in proportion to the travel; bolts and
  /// screws have the same waves whatever the travel.
  std::array<double, 3> stretch{1.0, 1.0, 1.0};
  [[nodiscard]] double length_of(int motion) const {
    return length[static_cast<std::size_t>(kind_of(motion))] *
           stretch[static_cast<std::size_t>(axis_of(motion))];
  }
  [[nodiscard]] double amplitude_of(int motion) const {
    return amplitude[static_cast<std::size_t>(kind_of(motion))] * relative[static_cast<std::size_t>(motion)];
  }
};

/// Expected `stretch` before measuring: half way, in the log, between waves in proportion to the travel and waves
/// that do not depend on it.
std::array<double, 3> expected_stretch(const std::array<Range, 3>& travel);

/// The prior's covariance of the spline coefficients of one error motion: Matern 5/2 at their places + diffuse slope
/// and offset (the gauge removes the latter).
Eigen::MatrixXd coefficient_covariance(const GeometricBasis& basis, const GeometricPrior& prior, int motion);
/// The strengths that evidence sets, as logs: three amplitudes, three lengths, two fine amplitudes and the fine length.
/// Then the factor of each error motion on its kind's amplitude, and of each axis on the length.
inline constexpr int first_relative = 9;
inline constexpr int first_stretch = first_relative + error_motion_count;
inline constexpr int strength_count = first_stretch + 3;
using Strengths = Eigen::Matrix<double, strength_count, 1>;
using StrengthMatrix = Eigen::Matrix<double, strength_count, strength_count>;
Strengths log_strengths(const GeometricPrior& prior);
GeometricPrior with_log_strengths(const GeometricPrior& prior, const Strengths& logs);

/// Derivative of an error motion's covariance by the log strengths that act on it alike.
struct CovarianceSlope {
  std::vector<int> strengths;
  Eigen::MatrixXd matrix;
};
std::vector<CovarianceSlope> coefficient_covariance_slopes(const GeometricBasis& basis,
                                                           const GeometricPrior& prior, int motion);

}  // namespace invar::metrology
