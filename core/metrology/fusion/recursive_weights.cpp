#include "core/metrology/fusion/recursive_weights.hpp"

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {
constexpr double unknown =
    1e12;  // variance before the first sample, and the most that forgetting lets it grow to
}

RecursiveWeights::RecursiveWeights(std::size_t sensors) {
  INVAR_EXPECTS(sensors >= 1 && sensors <= most_sensors, sensors);
  const auto n = static_cast<Eigen::Index>(sensors);
  theta_.setZero(n);
  covariance_.setZero(n, n);
  reset();
}

void RecursiveWeights::reset() noexcept {
  theta_.setZero();
  covariance_.setZero();
  covariance_.diagonal().setConstant(unknown);
}

void RecursiveWeights::add(const std::array<double, most_sensors>& sensors, double reference,
                           double keep) noexcept {
  const Eigen::Index n = theta_.size();
  Vector row(n);
  for (Eigen::Index i = 0; i + 1 < n; ++i) row(i) = sensors[static_cast<std::size_t>(i + 1)] - sensors[0];
  row(n - 1) = 1.0;
  const Vector spread = covariance_ * row;
  const double scale = 1.0 / (keep + row.dot(spread));
  theta_ += spread * (scale * (reference - sensors[0] - row.dot(theta_)));
  covariance_ -= scale * (spread * spread.transpose());
  // What no sample excites must not be forgotten without end.
  if (covariance_.trace() < unknown) covariance_ /= keep;
}

double RecursiveWeights::weight(std::size_t sensor) const noexcept {
  if (sensor > 0) return theta_(static_cast<Eigen::Index>(sensor) - 1);
  return 1.0 - theta_.head(theta_.size() - 1).sum();
}

}  // namespace invar::metrology
