#include "core/numerics/rbf_ridge.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/contract.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::numerics {

namespace {

std::vector<int> centre_counts(const Eigen::MatrixXd& x, const RidgeOptions& options) {
  if (!options.counts.empty()) return options.counts;
  std::vector<int> counts;
  for (Eigen::Index d = 0; d < x.rows(); ++d) {
    std::vector<double> values(static_cast<std::size_t>(x.cols()));
    for (Eigen::Index i = 0; i < x.cols(); ++i) values[static_cast<std::size_t>(i)] = x(d, i);
    std::sort(values.begin(), values.end());
    const auto distinct = std::unique(values.begin(), values.end()) - values.begin();
    counts.push_back(static_cast<int>(std::clamp<std::ptrdiff_t>(distinct, 1, 41)));
  }
  return counts;
}

/// The network's shape: ranges, scales, centres, widths; weights still zero.
RbfNetwork shape(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, const RidgeOptions& options) {
  RbfNetwork net;
  const Eigen::Index inputs = x.rows();
  net.input_offset.resize(inputs);
  net.input_scale.resize(inputs);
  std::vector<Range> scaled_range;
  for (Eigen::Index d = 0; d < inputs; ++d) {
    const Range range{x.row(d).minCoeff(), x.row(d).maxCoeff()};
    net.range.push_back(range);
    net.input_offset(d) = 0.5 * (range.lower + range.upper);
    const double half = range.width() > 0.0 ? 0.5 * range.width() : 1.0;
    net.input_scale(d) =
        options.input_scale.empty() ? half : options.input_scale[static_cast<std::size_t>(d)];
    const double reach = 0.5 * range.width() / net.input_scale(d);
    scaled_range.push_back({-reach, reach});
  }
  net.output_offset = y.mean();
  const double spread = std::sqrt((y.array() - net.output_offset).square().mean());
  net.output_scale = spread > 0.0 ? spread : 1.0;
  const auto counts = centre_counts(x, options);
  net.centres = uniform_centres(scaled_range, counts);
  net.widths.resize(inputs, net.centres.cols());
  for (Eigen::Index d = 0; d < inputs; ++d) {
    const auto at = static_cast<std::size_t>(d);
    const double spacing = counts[at] > 1 ? scaled_range[at].width() / (counts[at] - 1) : 1.0;
    const double factor = options.spacings.empty() ? 2.0 : options.spacings[at];
    net.widths.row(d).setConstant(spacing > 0.0 ? spacing * factor : factor);
  }
  net.weights = Eigen::VectorXd::Zero(net.centres.cols());
  net.slope = Eigen::VectorXd::Zero(inputs);
  return net;
}

/// Columns that are not penalised: constant, and slopes of inputs that vary.
Eigen::MatrixXd free_columns(const Eigen::MatrixXd& u, bool slope, std::vector<Eigen::Index>& slopes) {
  for (Eigen::Index d = 0; slope && d < u.rows(); ++d)
    if (u.row(d).maxCoeff() > u.row(d).minCoeff()) slopes.push_back(d);
  Eigen::MatrixXd columns(u.cols(), 1 + static_cast<Eigen::Index>(slopes.size()));
  columns.col(0).setOnes();
  for (std::size_t k = 0; k < slopes.size(); ++k)
    columns.col(static_cast<Eigen::Index>(k) + 1) = u.row(slopes[k]).transpose();
  return columns;
}

}  // namespace

double RidgeFit::sigma(const Eigen::Ref<const Eigen::VectorXd>& x) const {
  const Eigen::VectorXd u = network.scaled(x);
  const Eigen::Index inputs = network.inputs();
  Eigen::VectorXd basis(1 + inputs + network.size());
  basis << 1.0, u, network.activations(u);
  const double inside = network.output_scale * std::sqrt(std::max(0.0, basis.dot(covariance * basis)));
  return std::hypot(inside, rms_slope * network.distance_outside(x));
}

double RidgeFit::leave_one_out_rms() const {
  return std::sqrt(leave_one_out.squaredNorm() / static_cast<double>(leave_one_out.size()));
}

RidgeFit fit_ridge(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::VectorXd>& y,
                   const RidgeOptions& options) {
  const Eigen::Index n = x.cols();
  INVAR_EXPECTS(y.size() == n && n >= x.rows() + 2, y.size(), n, x.rows());
  RidgeFit fit;
  fit.network = shape(x, y, options);
  RbfNetwork& net = fit.network;
  const Eigen::MatrixXd u = ((x.colwise() - net.input_offset).array().colwise() / net.input_scale.array());
  Eigen::MatrixXd phi(n, net.size());
  for (Eigen::Index i = 0; i < n; ++i) phi.row(i) = net.activations(u.col(i)).transpose();
  const Eigen::VectorXd target = (y.array() - net.output_offset) / net.output_scale;

  // Free columns out: Q spans what they cannot reach, so that the smoother is F F' + Q V diag(.) V' Q'.
  std::vector<Eigen::Index> slopes;
  const Eigen::MatrixXd free = free_columns(u, options.slope, slopes);
  const Eigen::Index p = free.cols();
  const Eigen::MatrixXd q = full_q(free).rightCols(n - p);
  const Eigen::MatrixXd projected = q.transpose() * phi;
  const SymmetricEigen eigen = symmetric_eigen(projected * projected.transpose());
  const Eigen::VectorXd energy = eigen.values.cwiseMax(0.0);
  const Eigen::MatrixXd modes = q * eigen.vectors;  // n x (n - p)
  const Eigen::VectorXd coordinates = modes.transpose() * target;
  const auto count = static_cast<double>(n);

  // Residual of the ridge l: r = modes * (l / (energy + l) * coordinates); 1 - S_ii = row sums alike.
  const Eigen::MatrixXd squares = modes.cwiseAbs2();
  const auto score = [&](double ridge) {
    const Eigen::VectorXd shrink = ridge / (energy.array() + ridge);
    if (options.choice == RidgeChoice::leave_one_out) {
      const Eigen::VectorXd residual = modes * shrink.cwiseProduct(coordinates);
      return residual.cwiseQuotient((squares * shrink).cwiseMax(1e-12)).squaredNorm();
    }
    return count * shrink.cwiseProduct(coordinates).squaredNorm() / std::pow(shrink.sum(), 2);
  };
  fit.ridge = options.ridge * count;
  if (options.choice != RidgeChoice::fixed) {
    const double top = std::max(energy.maxCoeff(), 1e-300);
    double best = std::numeric_limits<double>::infinity();
    const auto search = [&](double from, double to, double step) {
      for (double exponent = from; exponent <= to; exponent += step) {
        const double candidate = top * std::pow(10.0, exponent);
        if (const double value = score(candidate); value < best) {
          best = value;
          fit.ridge = candidate;
        }
      }
    };
    search(-13.0, 2.0, 0.5);
    const double near = std::log10(fit.ridge / top);
    search(near - 0.4, near + 0.4, 0.1);
  }

  const Eigen::VectorXd shrink = fit.ridge / (energy.array() + fit.ridge);
  const Eigen::VectorXd residual = modes * shrink.cwiseProduct(coordinates);
  const double freedom = shrink.sum();
  fit.effective_parameters = count - freedom;
  fit.noise = net.output_scale * std::sqrt(residual.squaredNorm() / std::max(freedom, 1e-9));
  fit.leave_one_out = net.output_scale * residual.cwiseQuotient((squares * shrink).cwiseMax(1e-12));

  // w = phi' Q (P P' + l I)^-1 Q' t = phi' r / l; the free part from what w leaves over.
  net.weights = phi.transpose() * residual / fit.ridge;
  const Eigen::VectorXd coefficients = least_squares(free, target - phi * net.weights - residual);
  net.constant = coefficients(0);
  for (std::size_t k = 0; k < slopes.size(); ++k)
    net.slope(slopes[k]) = coefficients(static_cast<Eigen::Index>(k) + 1);

  const Eigen::Index inputs = x.rows();
  Eigen::MatrixXd all(n, p + net.size());
  all << free, phi;
  Eigen::MatrixXd information = all.transpose() * all;
  information.diagonal().tail(net.size()).array() += fit.ridge;
  const double variance = std::pow(fit.noise / net.output_scale, 2);
  const Eigen::MatrixXd inverse =
      variance * numerics::solve_symmetric(information,
                                           Eigen::MatrixXd::Identity(information.rows(), information.cols()));
  fit.covariance = Eigen::MatrixXd::Zero(1 + inputs + net.size(), 1 + inputs + net.size());
  std::vector<Eigen::Index> place{0};
  for (const Eigen::Index d : slopes) place.push_back(1 + d);
  for (Eigen::Index k = 0; k < net.size(); ++k) place.push_back(1 + inputs + k);
  for (std::size_t i = 0; i < place.size(); ++i)
    for (std::size_t j = 0; j < place.size(); ++j)
      fit.covariance(place[i], place[j]) =
          inverse(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));

  // How steep the network is on average, for holding beyond the range.
  double squared = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::VectorXd activation = net.activations(u.col(i)).cwiseProduct(net.weights);
    Eigen::VectorXd gradient = net.slope;
    for (Eigen::Index k = 0; k < net.size(); ++k)
      gradient -=
          activation(k) * (u.col(i) - net.centres.col(k)).cwiseQuotient(net.widths.col(k).cwiseAbs2());
    squared += gradient.squaredNorm();
  }
  fit.rms_slope = net.output_scale * std::sqrt(squared / count);
  return fit;
}

}  // namespace invar::numerics
