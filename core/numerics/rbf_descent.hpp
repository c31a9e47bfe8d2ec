// Gradient descent as in the thesis, kept to reproduce its figures; use fit_ridge for anything else.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/numerics/rbf_network.hpp"

namespace invar::numerics {

struct DescentOptions {
  double width = 0.05;             // in units of the scaled input
  double rate_weights = 0.01;      // eta_w
  double rate_centres = 0.01;      // eta_mu; 0 keeps the centres
  double stop_mean_square = 1e-3;  // Ems, in the unit of the scaled output, squared
  int most_epochs = 100'000;
};

struct DescentResult {
  RbfNetwork network;
  double mean_square = 0.0;  // of the last epoch, scaled output
  int epochs = 0;
  bool converged = false;  // mean_square fell below stop_mean_square
  bool diverged = false;   // not finite, or a centre more than ten ranges away
};

/// Thesis (2.11)-(2.14), corrected (docs/references.md#e4): error E = target - output, one pass over all samples an epoch,
/// `w += eta_w E phi(r)`, `mu += eta_mu E w phi(r) (x - mu) / s^2`. There are as many centres as samples, starting on them.
/// The input is scaled to [0, 1] over its range, the output by `output_scale` (um in the thesis: 1e-6 m).
///
/// It only works as early stopping: the centre update carries w / s^2 = 400 w, and centres run away.
DescentResult train_by_descent(const Eigen::Ref<const Eigen::MatrixXd>& x,
                               const Eigen::Ref<const Eigen::VectorXd>& y, double output_scale,
                               const DescentOptions& options = {});

}  // namespace invar::numerics
