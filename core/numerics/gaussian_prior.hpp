// Linear regression with a Gaussian prior: posterior and evidence from the normal equations.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace invar::numerics {

/// The sums a linear model needs of its readings: y = A theta + noise, noise ~ N(0, noise^2 / weight).
struct NormalEquations {
  Eigen::MatrixXd gram;     // A' W A
  Eigen::VectorXd moment;   // A' W y
  double energy = 0.0;      // y' W y
  double readings = 0.0;    // number with weight above zero
  double log_weight = 0.0;  // sum of log(weight) over those

  static NormalEquations of(const Eigen::Ref<const Eigen::MatrixXd>& rows,
                            const Eigen::Ref<const Eigen::VectorXd>& y,
                            const Eigen::Ref<const Eigen::VectorXd>& weights);
};

struct Posterior {
  Eigen::VectorXd mean;        // of theta
  Eigen::MatrixXd covariance;  // of theta; empty unless asked for
  double log_evidence = 0.0;   // log p(y | prior, noise), all constants in
};

enum class Covariance { left_out, found };

/// theta = L z, z ~ N(0, I): the prior covariance is L L', L lower triangular, block diagonal in the given
/// order. Whitening keeps the problem well conditioned however flat the prior is. O(M^3).
Posterior posterior(const NormalEquations& data, const std::vector<Eigen::MatrixXd>& prior_factors,
                    double noise, Covariance covariance);

/// Matern covariance of smoothness 5/2 at distance r, unit variance: once-differentiable curvature, hence
/// heavier tails in frequency than a Gaussian, hence an honest sigma between readings.
double matern52(double distance, double length);

/// Maximises f over R^n from `start` by a pattern search: each coordinate is moved by `step`, which halves
/// when nothing helps, down to `last_step`. For evidences of a few hyperparameters (in logarithms).
Eigen::VectorXd maximise(const std::function<double(const Eigen::VectorXd&)>& f, Eigen::VectorXd start,
                         double step, double last_step);

}  // namespace invar::numerics
