// Ridge regression of a Gaussian network's weights: closed form, the ridge by leave-one-out or GCV.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/numerics/rbf_network.hpp"

namespace invar::numerics {

enum class RidgeChoice { generalised_cross_validation, leave_one_out, fixed };

struct RidgeOptions {
  RidgeChoice choice = RidgeChoice::generalised_cross_validation;
  double ridge = 1e-6;              // for `fixed`, relative to the number of readings
  std::vector<int> counts;          // centres a dimension; empty: one a distinct value, at most 41
  std::vector<double> spacings;     // widths in centre spacings, a dimension; empty: 2
  std::vector<double> input_scale;  // empty: half the range of each input
  bool slope = true;                // explicit slope a dimension beside the constant, neither penalised
};

/// A network and what is known of it. Set-up only.
struct RidgeFit {
  RbfNetwork network;
  double ridge = 0.0;
  double noise = 0.0;                 // standard deviation of one reading, output units
  double effective_parameters = 0.0;  // trace of the smoother
  Eigen::VectorXd leave_one_out;      // N: reading minus the prediction of a fit without it, output units
  Eigen::MatrixXd covariance;         // (1 + D + M)^2 of constant, slope, weights, scaled

  /// Standard deviation of the predicted value at x (not of a single reading). Outside the range the value is
  /// held, and sigma grows by the RMS slope of the network times the distance.
  [[nodiscard]] double sigma(const Eigen::Ref<const Eigen::VectorXd>& x) const;
  [[nodiscard]] double leave_one_out_rms() const;

  double rms_slope = 0.0;  // output units per input scale
};

/// `x`: D x N in input units; `y`: N. Needs at least D + 2 readings, all finite.
///
/// The constant and slopes are eliminated first, and the rest is diagonalised once. Each candidate ridge then costs
/// O(N^2): `GCV(l) = N |r|^2 / (N - tr S)^2` and leave-one-out residuals `r_i / (1 - S_ii)`
/// (Golub, Heath, Wahba 1979).
RidgeFit fit_ridge(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::VectorXd>& y,
                   const RidgeOptions& options = {});

}  // namespace invar::numerics
