// Gaussian network with a centre on every reading, for scattered readings of few inputs (kernel ridge regression).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/numerics/rbf_network.hpp"

namespace invar::numerics {

struct KernelOptions {
  std::vector<double> input_scale;  // a length that matters in each input; empty: half the range
  std::vector<double> lengths{0.5, 0.7, 1.0, 1.5, 2.5};  // candidate widths, scaled
  std::vector<double> ridges{1e-4, 1e-3, 1e-2,
                             0.03, 0.1,  0.3};  // candidate ridges (noise over signal, squared)
};

struct KernelFit {
  RbfNetwork network;
  double length = 0.0;
  double ridge = 0.0;
  Eigen::VectorXd leave_one_out;  // N: reading minus the prediction without it, output units
  [[nodiscard]] double leave_one_out_rms() const;
};

/// `x`: D x N in input units, `y`: N. (K + ridge I) w = y - mean; width and ridge by the leave-one-out error in
/// closed form, w_i / (K + ridge I)^-1_ii. Use `fit_ridge` where readings lie on a line or grid.
KernelFit fit_kernel(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::VectorXd>& y,
                     const KernelOptions& options = {});

}  // namespace invar::numerics
