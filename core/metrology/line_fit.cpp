#include "core/metrology/line_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/numerics/robust.hpp"

namespace invar::metrology {

namespace {

double standardised_scale(const LineFit& work) {
  // Residuals are smaller than errors by the degrees of freedom spent.
  std::vector<double> size;
  for (int i = 0; i < work.rows(); ++i)
    if (work.weights[i] > 0.0) size.push_back(std::abs(work.residual[i]));
  const double rows = static_cast<double>(size.size());
  if (work.degrees < 3.0) return std::numeric_limits<double>::quiet_NaN();
  return 1.4826 * numerics::median(size) * std::sqrt(rows / work.degrees);
}

/// From neighbours in time, which steps and drift hardly touch.
double first_scale(LineFit& work) {
  std::vector<std::vector<double>> of_point(work.first_row.size());
  for (int i = 0; i < work.rows(); ++i)
    of_point[static_cast<std::size_t>(work.point_of[static_cast<std::size_t>(i)])].push_back(work.y[i]);
  std::vector<double> middle;
  middle.reserve(of_point.size());
  for (const auto& values : of_point) middle.push_back(numerics::median(values));
  work.residual.resize(work.rows());
  for (int i = 0; i < work.rows(); ++i)
    work.residual[i] =
        work.y[i] - middle[static_cast<std::size_t>(work.point_of[static_cast<std::size_t>(i)])];
  std::vector<double> steps;
  for (int i = 1; i < work.rows(); ++i) steps.push_back(std::abs(work.residual[i] - work.residual[i - 1]));
  return 1.4826 * numerics::median(steps) / std::sqrt(2.0);
}

void huber_weights(LineFit& work) {
  for (int i = 0; i < work.rows(); ++i) {
    const double z = std::abs(work.residual[i]) / (2.0 * work.scale);
    work.weights[i] = z < 1.0 ? 1.0 : 1.0 / z;
  }
}

/// Adds the step that explains most, if it explains more than chance: returns whether one was found.
bool find_break(LineFit& work) {
  constexpr double significance = 36.0;  // chi-square of one parameter: six sigma
  const int rows = work.rows();
  double best = significance;
  int where = 0;
  Eigen::VectorXd mass = Eigen::VectorXd::Constant(work.points(), 1e-12);
  for (int i = 0; i < rows; ++i) mass[work.point_of[static_cast<std::size_t>(i)]] += work.weights[i];
  Eigen::VectorXd above = Eigen::VectorXd::Zero(work.points());
  // A step against means and regressors: its part that they cannot follow.
  Eigen::MatrixXd centred(rows, work.regressors.cols());
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(work.points(), work.regressors.cols());
  for (int i = 0; i < rows; ++i)
    cross.row(work.point_of[static_cast<std::size_t>(i)]) += work.weights[i] * work.regressors.row(i);
  for (int i = 0; i < rows; ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    centred.row(i) = work.regressors.row(i) - cross.row(j) / mass[j];
  }
  Eigen::VectorXd shared = Eigen::VectorXd::Zero(work.regressors.cols());
  double moment = 0.0;
  double energy = 0.0;
  for (int b = rows - 1; b > 1; --b) {  // the step from row b on
    const int j = work.point_of[static_cast<std::size_t>(b)];
    const double w = work.weights[b];
    moment += w * work.residual[b];
    shared += w * centred.row(b).transpose();
    energy += w - (2.0 * above[j] * w + w * w) / mass[j];
    above[j] += w;
    if (rows - b < 3) continue;
    const double left = energy - shared.dot(work.nuisance_covariance * shared);
    if (left < 1e-3) continue;
    const double gain = moment * moment / left / (work.scale * work.scale);
    if (gain > best) {
      best = gain;
      where = b;
    }
  }
  if (where == 0) return false;
  work.breaks.push_back(where);
  work.regressors.conservativeResize(Eigen::NoChange, work.regressors.cols() + 1);
  for (int i = 0; i < rows; ++i) work.regressors(i, work.regressors.cols() - 1) = i >= where ? 1.0 : 0.0;
  return true;
}

}  // namespace

void fit(LineFit& work, const Eigen::VectorXd& prior_variance) {
  // The point means are eliminated first: their normal matrix is diagonal.
  const Eigen::Index q = work.regressors.cols();
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(work.points());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(work.points());
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(work.points(), q);
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    mass[j] += work.weights[i];
    sum[j] += work.weights[i] * work.y[i];
    cross.row(j) += work.weights[i] * work.regressors.row(i);
  }
  for (int j = 0; j < work.points(); ++j) {
    const double m = std::max(mass[j], 1e-12);
    sum[j] /= m;
    cross.row(j) /= m;
  }
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(q, q);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(q);
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    const Eigen::VectorXd centred = work.regressors.row(i) - cross.row(j);
    normal.noalias() += work.weights[i] * centred * centred.transpose();
    right += work.weights[i] * (work.y[i] - sum[j]) * centred;
  }
  const double variance = work.scale * work.scale;
  for (Eigen::Index k = 0; k < q; ++k) normal(k, k) += variance / prior_variance[k] + 1e-12;
  work.nuisance_covariance = normal.ldlt().solve(Eigen::MatrixXd::Identity(q, q));
  work.nuisance = work.nuisance_covariance * right;
  work.residual.resize(work.rows());
  for (int i = 0; i < work.rows(); ++i) {
    const int j = work.point_of[static_cast<std::size_t>(i)];
    work.residual[i] = work.y[i] - sum[j] - (work.regressors.row(i) - cross.row(j)).dot(work.nuisance);
  }
  double seen = 0.0;
  for (int j = 0; j < work.points(); ++j) seen += mass[j] > 1e-9 ? 1.0 : 0.0;
  work.degrees = work.weights.sum() - seen - static_cast<double>(work.breaks.size()) - 2.0;
}

void tukey_weights(LineFit& work) {
  for (int i = 0; i < work.rows(); ++i) {
    const double z = work.residual[i] / (6.0 * work.scale);
    work.weights[i] = std::abs(z) < 1.0 ? (1.0 - z * z) * (1.0 - z * z) : 0.0;
  }
}

Eigen::VectorXd prior_variances(const LineFit& work, const std::array<double, drift_terms>& drift) {
  Eigen::VectorXd variance = Eigen::VectorXd::Constant(work.regressors.cols(), wide * wide);
  for (int k = 0; k < drift_terms; ++k) variance[1 + k] = std::max(drift[static_cast<std::size_t>(k)], 1e-22);
  if (work.expanding) variance[nuisances] = expansion_sd * expansion_sd;
  return variance;
}

void fit_robustly(LineFit& work, const std::array<double, drift_terms>& drift, double floor) {
  work.scale = std::max(first_scale(work), floor);
  huber_weights(work);
  for (int attempt = 0; attempt < 4; ++attempt) {
    for (int i = 0; i < 4; ++i) {
      fit(work, prior_variances(work, drift));
      huber_weights(work);
    }
    fit(work, prior_variances(work, drift));
    if (const double scale = standardised_scale(work); std::isfinite(scale))
      work.scale = std::max(scale, floor);
    if (work.degrees < 10.0 || !find_break(work)) break;
  }
  for (int i = 0; i < 6; ++i) {
    if (const double scale = standardised_scale(work); std::isfinite(scale))
      work.scale = std::max(scale, floor);
    tukey_weights(work);
    fit(work, prior_variances(work, drift));
  }
}

}  // namespace invar::metrology
