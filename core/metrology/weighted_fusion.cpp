#include "core/metrology/weighted_fusion.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {
constexpr double speed_memory = 0.05;  // [s]
}

WeightFit fit_weights(const Eigen::Ref<const Eigen::MatrixXd>& sensors,
                      const Eigen::Ref<const Eigen::VectorXd>& reference) {
  const Eigen::Index n = sensors.cols();
  INVAR_EXPECTS(sensors.rows() == reference.size() && n >= 1, sensors.rows(), reference.size());
  Eigen::MatrixXd a(sensors.rows(), n);  // differences from the first sensor, and one
  a.leftCols(n - 1) = sensors.rightCols(n - 1).colwise() - sensors.col(0);
  a.col(n - 1).setOnes();
  const Eigen::VectorXd y = reference - sensors.col(0);
  const Eigen::VectorXd theta = a.colPivHouseholderQr().solve(y);
  WeightFit fit;
  fit.weights.resize(n);
  fit.weights.tail(n - 1) = theta.head(n - 1);
  fit.weights(0) = 1.0 - theta.head(n - 1).sum();
  fit.intercept = theta(n - 1);
  fit.rms = std::sqrt((y - a * theta).squaredNorm() / static_cast<double>(y.size()));
  return fit;
}

RecursiveWeights::RecursiveWeights(Eigen::Index sensors, double forgetting)
    : forgetting_{forgetting},
      theta_{Eigen::VectorXd::Zero(sensors)},
      covariance_{Eigen::MatrixXd::Identity(sensors, sensors) * 1e12},
      row_{Eigen::VectorXd::Zero(sensors)},
      gain_{Eigen::VectorXd::Zero(sensors)} {
  INVAR_EXPECTS(sensors >= 1 && forgetting > 0.0 && forgetting <= 1.0, sensors, forgetting);
}

void RecursiveWeights::add(const Eigen::Ref<const Eigen::VectorXd>& sensors, double reference) noexcept {
  const Eigen::Index n = theta_.size();
  for (Eigen::Index i = 0; i + 1 < n; ++i) row_(i) = sensors(i + 1) - sensors(0);
  row_(n - 1) = 1.0;
  gain_.noalias() = covariance_ * row_;
  const double scale = 1.0 / (forgetting_ + row_.dot(gain_));
  const double error = reference - sensors(0) - row_.dot(theta_);
  theta_ += gain_ * (error * scale);
  covariance_.noalias() -= (scale * gain_) * gain_.transpose();
  covariance_ /= forgetting_;
}

Eigen::VectorXd RecursiveWeights::weights() const {
  const Eigen::Index n = theta_.size();
  Eigen::VectorXd weights(n);
  weights.tail(n - 1) = theta_.head(n - 1);
  weights(0) = 1.0 - theta_.head(n - 1).sum();
  return weights;
}

Eigen::VectorXd weights_at(const WeightModel& model, double speed, double noise_level) {
  const Eigen::Index n = model.positions + model.velocities;
  Eigen::VectorXd weights(n);
  const Eigen::Vector2d at{speed, noise_level};
  for (Eigen::Index i = 1; i < n; ++i)
    weights(i) = std::clamp(model.weights[static_cast<std::size_t>(i - 1)](at), 0.0, 1.0);
  const double others = weights.tail(n - 1).sum();
  if (others > 1.0) weights.tail(n - 1) /= others;
  weights(0) = 1.0 - std::min(others, 1.0);
  return weights;
}

Eigen::VectorXd monomials(double m, double d, int degree) {
  Eigen::VectorXd terms((degree + 1) * (degree + 2) / 2);
  Eigen::Index k = 0;
  for (int total = 0; total <= degree; ++total)
    for (int q = 0; q <= total; ++q) terms(k++) = std::pow(m, total - q) * std::pow(d, q);
  return terms;
}

WeightedFusion::WeightedFusion(const WeightModel& model) : model_{model} {
  INVAR_EXPECTS(model.positions >= 1 && model.positions + model.velocities <= static_cast<int>(most_sensors),
                model.positions, model.velocities);
  for (const numerics::RbfNetwork& network : model.weights)
    tables_.push_back(numerics::compile<2>(network, 2e-3, 1U << 14U).table);
  reset();
}

void WeightedFusion::reset() noexcept {
  integral_.fill(0.0);
  last_.fill(std::numeric_limits<double>::quiet_NaN());
  repeats_.fill(0);
  moved_ = speed_ = spread_ = largest_ = fused_ = 0.0;
  started_ = false;
}

FusedPosition WeightedFusion::step(const FusionSample& sample) noexcept {
  const auto positions = static_cast<std::size_t>(model_.positions);
  const auto velocities = static_cast<std::size_t>(model_.velocities);
  const std::size_t all = positions + velocities;
  std::array<double, 2 * most_sensors> value{};
  FusedPosition fused;
  if (!started_) {
    double begin = 0.0;
    for (std::size_t i = 0; i < positions; ++i)
      if (std::isfinite(sample.positions[i])) {
        begin = sample.positions[i];
        break;
      }
    integral_.fill(begin);
    fused_ = begin;
    started_ = true;
  }
  const double forget = std::exp(-sample.period / speed_memory);
  double step_moved = 0.0;
  for (std::size_t i = 0; i < all; ++i) {
    const bool is_position = i < positions;
    const double reading = is_position ? sample.positions[i] : sample.velocities[i - positions];
    const bool same = reading == last_[i];
    repeats_[i] = same ? repeats_[i] + 1 : 0;
    bool sound = std::isfinite(reading);
    if (!is_position) {
      const std::size_t k = i - positions;
      sound = sound && repeats_[i] < 5;
      if (sound) {
        const double before = std::isfinite(last_[i]) ? last_[i] : reading;
        integral_[k] += 0.5 * (reading + before) * sample.period;
        if (k == 0) {
          step_moved = 0.5 * (reading + before) * sample.period;
          speed_ = forget * speed_ + (1.0 - forget) * reading;
          spread_ = 0.99 * spread_ + 0.01 * std::pow(reading - before, 2);
          largest_ = std::max(largest_, std::abs(speed_));
        }
      } else {
        // Carried on with the fused position, so that a sensor that returns does so without a step.
        integral_[k] = fused_;
      }
      value[i] = integral_[k];
    } else {
      if (!same) moved_ = 0.0;
      value[i] = reading;
    }
    last_[i] = reading;
    if (sound) fused.live |= 1U << i;
  }
  moved_ += step_moved;
  // A position that stands still while the velocity has moved on by far more than it steps: stuck.
  if (velocities > 0 && (fused.live >> positions & 1U) != 0U && std::abs(moved_) > 0.005)
    for (std::size_t i = 0; i < positions; ++i)
      if (repeats_[i] > 20) fused.live &= ~(1U << i);

  const double level = std::isfinite(sample.noise_level)
                           ? sample.noise_level
                           : std::sqrt(1.5 * spread_) / std::max(largest_, 1e-9);
  double others = 0.0;
  for (std::size_t i = 1; i < all; ++i) {
    const double weight = tables_[i - 1]({std::abs(speed_), level});
    fused.weights[i] = weight > 0.0 ? (weight < 1.0 ? weight : 1.0) : 0.0;
    others += fused.weights[i];
  }
  fused.weights[0] = others < 1.0 ? 1.0 - others : 0.0;
  double total = 0.0;
  for (std::size_t i = 0; i < all; ++i) {
    if ((fused.live >> i & 1U) == 0U) fused.weights[i] = 0.0;
    total += fused.weights[i];
  }
  if (total <= 0.0)  // what lives has no weight here: share alike
    for (std::size_t i = 0; i < all; ++i)
      if ((fused.live >> i & 1U) != 0U) total += fused.weights[i] = 1.0;
  if (total > 0.0) {
    double mean = 0.0;
    double difference = 0.0;
    for (std::size_t i = 0; i < all; ++i) {
      fused.weights[i] /= total;
      if (fused.weights[i] > 0.0) mean += fused.weights[i] * value[i];
    }
    if (all >= 2 && (fused.live & 1U) != 0U && std::isfinite(value[all - 1]))
      difference = value[all - 1] - value[0];
    fused_ = mean + model_.intercept;
    if (model_.degree > 1) {
      const double m = mean / model_.scale;
      const double d = difference / model_.scale;
      double sum = 0.0;
      Eigen::Index k = 0;
      for (int order = 0; order <= model_.degree; ++order)
        for (int q = 0; q <= order; ++q) {
          double term = 1.0;
          for (int p = 0; p < order - q; ++p) term *= m;
          for (int p = 0; p < q; ++p) term *= d;
          sum += model_.polynomial(k++) * term;
        }
      fused_ = sum * model_.scale;
    }
  }
  fused.position = fused_;
  fused.velocity = speed_;
  fused.sigma = std::numeric_limits<double>::quiet_NaN();  // the method does not know
  return fused;
}

}  // namespace invar::metrology
