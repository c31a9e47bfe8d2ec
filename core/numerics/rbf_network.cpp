#include "core/numerics/rbf_network.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"

namespace invar::numerics {

Eigen::VectorXd RbfNetwork::scaled(const Eigen::Ref<const Eigen::VectorXd>& x) const {
  INVAR_EXPECTS(x.size() == inputs(), x.size(), inputs());
  Eigen::VectorXd u(x.size());
  for (Eigen::Index d = 0; d < x.size(); ++d)
    u(d) = (range[static_cast<std::size_t>(d)].clamp(x(d)) - input_offset(d)) / input_scale(d);
  return u;
}

Eigen::VectorXd RbfNetwork::activations(const Eigen::Ref<const Eigen::VectorXd>& u) const {
  return (-0.5 * ((-centres).colwise() + u).cwiseQuotient(widths).colwise().squaredNorm()).array().exp();
}

double RbfNetwork::operator()(const Eigen::Ref<const Eigen::VectorXd>& x) const {
  const Eigen::VectorXd u = scaled(x);
  double y = constant;
  if (slope.size() > 0) y += slope.dot(u);
  if (size() > 0) y += weights.dot(activations(u));
  return output_offset + output_scale * y;
}

double RbfNetwork::operator()(double x) const { return (*this)(Eigen::VectorXd::Constant(1, x)); }

double RbfNetwork::distance_outside(const Eigen::Ref<const Eigen::VectorXd>& x) const {
  double squared = 0.0;
  for (Eigen::Index d = 0; d < x.size(); ++d) {
    const double beyond = (x(d) - range[static_cast<std::size_t>(d)].clamp(x(d))) / input_scale(d);
    squared += beyond * beyond;
  }
  return std::sqrt(squared);
}

double RbfNetwork::curvature_bound(Eigen::Index d) const {
  const double sum = (weights.cwiseAbs().array() / widths.row(d).transpose().array().square()).sum();
  return std::abs(output_scale) * sum / (input_scale(d) * input_scale(d));
}

Eigen::MatrixXd uniform_centres(const std::vector<Range>& ranges, const std::vector<int>& counts) {
  INVAR_EXPECTS(ranges.size() == counts.size(), ranges.size(), counts.size());
  Eigen::Index total = 1;
  for (const int n : counts) total *= n;
  Eigen::MatrixXd centres(static_cast<Eigen::Index>(ranges.size()), total);
  for (Eigen::Index k = 0; k < total; ++k) {
    Eigen::Index rest = k;
    for (std::size_t d = 0; d < ranges.size(); ++d) {
      const Eigen::Index n = counts[d];
      const double fraction = n > 1 ? static_cast<double>(rest % n) / static_cast<double>(n - 1) : 0.5;
      centres(static_cast<Eigen::Index>(d), k) = ranges[d].lower + fraction * ranges[d].width();
      rest /= n;
    }
  }
  return centres;
}

}  // namespace invar::numerics
