#include "core/numerics/rbf_descent.hpp"

#include <cmath>

#include "core/base/contract.hpp"

namespace invar::numerics {

DescentResult train_by_descent(const Eigen::Ref<const Eigen::MatrixXd>& x,
                               const Eigen::Ref<const Eigen::VectorXd>& y, double output_scale,
                               const DescentOptions& options) {
  INVAR_EXPECTS(x.cols() == y.size() && y.size() > 0, x.cols(), y.size());
  DescentResult result;
  RbfNetwork& net = result.network;
  const Eigen::Index inputs = x.rows();
  const Eigen::Index n = x.cols();
  net.input_offset = x.rowwise().minCoeff();
  net.input_scale = x.rowwise().maxCoeff() - net.input_offset;
  for (Eigen::Index d = 0; d < inputs; ++d) {
    net.range.push_back({net.input_offset(d), net.input_offset(d) + net.input_scale(d)});
    if (net.input_scale(d) <= 0.0) net.input_scale(d) = 1.0;
  }
  net.output_scale = output_scale;
  const Eigen::MatrixXd u = (x.colwise() - net.input_offset).array().colwise() / net.input_scale.array();
  const Eigen::VectorXd target = y / output_scale;
  net.centres = u;
  net.widths = Eigen::MatrixXd::Constant(inputs, n, options.width);
  net.weights = Eigen::VectorXd::Zero(n);
  net.slope = Eigen::VectorXd::Zero(inputs);
  const double inverse = 1.0 / (options.width * options.width);
  for (result.epochs = 0; result.epochs < options.most_epochs;) {
    double squares = 0.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::MatrixXd apart = (-net.centres).colwise() + u.col(i);
      const Eigen::VectorXd phi = (-0.5 * inverse * apart.colwise().squaredNorm()).array().exp();
      const double error = target(i) - net.weights.dot(phi);
      squares += error * error;
      if (options.rate_centres != 0.0) {
        const Eigen::VectorXd push = options.rate_centres * error * inverse * net.weights.cwiseProduct(phi);
        net.centres += apart * push.asDiagonal();
      }
      net.weights += options.rate_weights * error * phi;
    }
    ++result.epochs;
    result.mean_square = squares / static_cast<double>(n);
    result.diverged = !std::isfinite(result.mean_square) || net.centres.cwiseAbs().maxCoeff() > 10.0;
    result.converged = result.mean_square < options.stop_mean_square;
    if (result.diverged || result.converged) break;
  }
  return result;
}

}  // namespace invar::numerics
