// GeometricPrior: what is expected of error motions before anybody measures; its strengths come from evidence.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/metrology/geometric_basis.hpp"

namespace invar::metrology {

/// Kinds of error motion that share an amplitude and a length.
enum class MotionKind { positioning = 0, straightness = 1, angle = 2 };
MotionKind kind_of(int component);

/// Strengths of the prior, by kind. A roughness penalty is no substitute: it leaves what the lines do not see with
/// a huge prior (metrology.md section 4).
struct GeometricPrior {
  std::array<double, 3> amplitude{2e-6, 2e-6, 8e-6};  // m, m, rad: sd of the waviness
  std::array<double, 3> length{0.07, 0.07, 0.07};     // m, over which it changes (Matern 5/2)
  /// On top of it what repeats over a few centimetres, as a screw's pitch does. Angles have none: it would move nothing.
  std::array<double, 3> fine_amplitude{3e-7, 2e-7, 0.0};  // m, m, rad
  double fine_length = 0.012;                             // m
  double positioning_slope = 2e-4;                        // sd of the scale error of an axis
  double angle_slope = 2.0;  // sd of an angle's linear part over the axis' range, in amplitudes
  double squareness = 5e-3;  // rad, sd
};

/// The prior's covariance of the spline coefficients of one component: Matern 5/2 at their places + diffuse slope
/// and offset (the gauge removes the latter).
Eigen::MatrixXd coefficient_covariance(const GeometricBasis& basis, const GeometricPrior& prior,
                                       int component);
/// The strengths that evidence sets, as logs: three amplitudes, three lengths, two fine amplitudes, the fine length.
inline constexpr int strength_count = 9;
using Strengths = Eigen::Matrix<double, strength_count, 1>;
Strengths log_strengths(const GeometricPrior& prior);
GeometricPrior with_log_strengths(const GeometricPrior& prior, const Strengths& logs);

/// Derivatives of a component's covariance by the log strengths that act on it.
struct CovarianceSlope {
  int strength = 0;
  Eigen::MatrixXd matrix;
};
std::vector<CovarianceSlope> coefficient_covariance_slopes(const GeometricBasis& basis,
                                                           const GeometricPrior& prior, int component);

}  // namespace invar::metrology
