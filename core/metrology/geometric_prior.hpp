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
  double positioning_slope = 2e-4;                    // sd of the scale error of an axis
  double angle_slope = 2.0;  // sd of an angle's linear part over the axis' range, in amplitudes
  double squareness = 5e-3;  // rad, sd
};

/// The prior's covariance of the spline coefficients of one component: Matern 5/2 at their places + diffuse slope
/// and offset (the gauge removes the latter).
Eigen::MatrixXd coefficient_covariance(const GeometricBasis& basis, const GeometricPrior& prior,
                                       int component);
/// Its derivative by log amplitude and by log length.
struct CovarianceSlopes {
  Eigen::MatrixXd by_amplitude;
  Eigen::MatrixXd by_length;
};
CovarianceSlopes coefficient_covariance_slopes(const GeometricBasis& basis, const GeometricPrior& prior,
                                               int component);

}  // namespace invar::metrology
