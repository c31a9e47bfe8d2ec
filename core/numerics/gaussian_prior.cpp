#include "core/numerics/gaussian_prior.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/contract.hpp"

namespace invar::numerics {

NormalEquations NormalEquations::of(const Eigen::Ref<const Eigen::MatrixXd>& rows,
                                    const Eigen::Ref<const Eigen::VectorXd>& y,
                                    const Eigen::Ref<const Eigen::VectorXd>& weights) {
  NormalEquations sums;
  const Eigen::VectorXd root = weights.cwiseSqrt();
  const Eigen::MatrixXd scaled = root.asDiagonal() * rows;
  sums.gram = Eigen::MatrixXd::Zero(rows.cols(), rows.cols());
  sums.gram.selfadjointView<Eigen::Lower>().rankUpdate(scaled.transpose());
  sums.gram.triangularView<Eigen::StrictlyUpper>() = sums.gram.transpose();
  sums.moment = scaled.transpose() * root.cwiseProduct(y);
  sums.energy = root.cwiseProduct(y).squaredNorm();
  for (const double weight : weights) {
    if (weight <= 0.0) continue;
    sums.readings += 1.0;
    sums.log_weight += std::log(weight);
  }
  return sums;
}

Posterior posterior(const NormalEquations& data, const std::vector<Eigen::MatrixXd>& prior_factors,
                    double noise, Covariance covariance) {
  const bool with_covariance = covariance == Covariance::found;
  const double precision = 1.0 / (noise * noise);
  const Eigen::Index size = data.gram.rows();
  Eigen::MatrixXd h(size, size);  // lower part only
  Eigen::VectorXd b(size);
  Eigen::Index row = 0;
  for (const Eigen::MatrixXd& left : prior_factors) {
    Eigen::Index column = 0;
    for (const Eigen::MatrixXd& right : prior_factors) {
      if (column > row) break;
      const Eigen::MatrixXd inner =
          data.gram.block(row, column, left.rows(), right.rows()) * right.triangularView<Eigen::Lower>();
      const Eigen::MatrixXd whitened = left.transpose().triangularView<Eigen::Upper>() * inner;
      h.block(row, column, left.rows(), right.rows()) = precision * whitened;
      column += right.rows();
    }
    b.segment(row, left.rows()) = precision * (left.transpose() * data.moment.segment(row, left.rows()));
    row += left.rows();
  }
  INVAR_EXPECTS(row == size, row, size);
  h.diagonal().array() += 1.0;
  const Eigen::LLT<Eigen::MatrixXd> llt{h};
  const Eigen::VectorXd z = llt.solve(b);
  Posterior result;
  const double log_det = 2.0 * llt.matrixLLT().diagonal().array().log().sum();
  result.log_evidence =
      -0.5 * (precision * data.energy - b.dot(z) + log_det +
              data.readings * std::log(2.0 * std::numbers::pi * noise * noise) - data.log_weight);
  if (llt.info() != Eigen::Success || !std::isfinite(result.log_evidence))
    result.log_evidence = -std::numeric_limits<double>::infinity();
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(with_covariance ? size : 0, with_covariance ? size : 0);
  result.mean.resize(size);
  row = 0;
  for (const Eigen::MatrixXd& factor : prior_factors) {
    result.mean.segment(row, factor.rows()) = factor * z.segment(row, factor.rows());
    if (with_covariance)
      whole.block(row, row, factor.rows(), factor.rows()) = factor.triangularView<Eigen::Lower>();
    row += factor.rows();
  }
  if (with_covariance) {
    const Eigen::MatrixXd half = llt.matrixL().solve(Eigen::MatrixXd(whole.transpose()));
    result.covariance = half.transpose() * half;
  }
  return result;
}

double matern52(double distance, double length) {
  const double r = std::sqrt(5.0) * std::abs(distance) / length;
  return (1.0 + r + r * r / 3.0) * std::exp(-r);
}

Eigen::VectorXd maximise(const std::function<double(const Eigen::VectorXd&)>& f, Eigen::VectorXd start,
                         double step, double last_step) {
  double best = f(start);
  Eigen::VectorXd direction = Eigen::VectorXd::Ones(start.size());
  for (; step >= last_step; step *= 0.5) {
    for (bool moved = true; moved;) {
      moved = false;
      for (Eigen::Index k = 0; k < start.size(); ++k) {
        for (int side = 0; side < 2; ++side) {
          Eigen::VectorXd trial = start;
          trial(k) += step * direction(k);
          if (const double value = f(trial); value > best + 1e-3) {
            best = value;
            start = trial;
            moved = true;
            break;
          }
          direction(k) = -direction(k);  // the other side now, and first next time
        }
      }
    }
  }
  return start;
}

}  // namespace invar::numerics
