#include "core/numerics/rbf_kernel.hpp"

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "core/base/contract.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::numerics {

double KernelFit::leave_one_out_rms() const {
  return std::sqrt(leave_one_out.squaredNorm() / static_cast<double>(leave_one_out.size()));
}

KernelFit fit_kernel(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::VectorXd>& y,
                     const KernelOptions& options) {
  const Eigen::Index n = x.cols();
  INVAR_EXPECTS(n >= 2 && y.size() == n, n, y.size());
  KernelFit fit;
  RbfNetwork& net = fit.network;
  net.input_offset = Eigen::VectorXd::Zero(x.rows());
  net.input_scale.resize(x.rows());
  for (Eigen::Index d = 0; d < x.rows(); ++d) {
    net.range.push_back({x.row(d).minCoeff(), x.row(d).maxCoeff()});
    const double half = 0.5 * net.range.back().width();
    net.input_scale(d) = options.input_scale.empty() ? (half > 0.0 ? half : 1.0)
                                                     : options.input_scale[static_cast<std::size_t>(d)];
  }
  net.output_offset = y.mean();
  net.slope = Eigen::VectorXd::Zero(x.rows());
  net.centres = x.array().colwise() / net.input_scale.array();
  Eigen::MatrixXd squared(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    squared.col(i) = (net.centres.colwise() - net.centres.col(i)).colwise().squaredNorm().transpose();
  const Eigen::VectorXd target = y.array() - net.output_offset;
  double best = std::numeric_limits<double>::infinity();
  for (const double length : options.lengths) {
    const Eigen::MatrixXd kernel = (-0.5 / (length * length) * squared).array().exp();
    for (const double ridge : options.ridges) {
      Eigen::MatrixXd k = kernel;
      k.diagonal().array() += ridge;
      const Eigen::MatrixXd inverse = numerics::solve_positive(k, Eigen::MatrixXd::Identity(n, n));
      const Eigen::VectorXd weights = inverse * target;
      const Eigen::VectorXd left_out = weights.cwiseQuotient(inverse.diagonal());
      if (left_out.squaredNorm() >= best) continue;
      best = left_out.squaredNorm();
      fit.length = length;
      fit.ridge = ridge;
      fit.leave_one_out = left_out;
      net.weights = weights;
    }
  }
  net.widths = Eigen::MatrixXd::Constant(x.rows(), n, fit.length);
  return fit;
}

}  // namespace invar::numerics
