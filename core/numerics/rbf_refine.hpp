// Moves centres and widths of a network by nonlinear least squares, where few centres must do.
#pragma once

#include <Eigen/Core>

#include "core/numerics/rbf_network.hpp"

namespace invar::numerics {

struct RefineResult {
  RbfNetwork network;
  double rms_before = 0.0;  // of the residuals, output units
  double rms_after = 0.0;
  bool converged = false;
};

/// Levenberg-Marquardt (Ceres) over weights, constant, slopes, centres and log widths, from the given
/// network. On uniform data with a centre a sample it buys nothing over `fit_ridge` (metrology.md section 8);
/// it helps where twelve centres shall do the work of forty. Set-up only.
RefineResult refine(const RbfNetwork& start, const Eigen::Ref<const Eigen::MatrixXd>& x,
                    const Eigen::Ref<const Eigen::VectorXd>& y, int most_iterations = 50);

}  // namespace invar::numerics
