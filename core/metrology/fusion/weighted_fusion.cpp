#include "core/metrology/fusion/weighted_fusion.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/contract.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {
constexpr double speed_memory = 0.05;  // [s]
constexpr double hardest = 100.0;      // acceleration that an axis may have [m/s2]
constexpr int to_agree = 20;           // readings of a sensor that leapt
}  // namespace

WeightFit fit_weights(const Eigen::Ref<const Eigen::MatrixXd>& sensors,
                      const Eigen::Ref<const Eigen::VectorXd>& reference) {
  const Eigen::Index n = sensors.cols();
  INVAR_EXPECTS(sensors.rows() == reference.size() && n >= 1, sensors.rows(), reference.size());
  Eigen::MatrixXd a(sensors.rows(), n);  // differences from the first sensor, and one
  a.leftCols(n - 1) = sensors.rightCols(n - 1).colwise() - sensors.col(0);
  a.col(n - 1).setOnes();
  const Eigen::VectorXd y = reference - sensors.col(0);
  const Eigen::VectorXd theta = numerics::least_squares(a, y);
  WeightFit fit;
  fit.weights.resize(n);
  fit.weights.tail(n - 1) = theta.head(n - 1);
  fit.weights(0) = 1.0 - theta.head(n - 1).sum();
  fit.intercept = theta(n - 1);
  fit.rms = std::sqrt((y - a * theta).squaredNorm() / static_cast<double>(y.size()));
  return fit;
}

double NoiseBySpeed::operator()(double at) const noexcept {
  const std::size_t n = speed.size();
  if (n == 0) return 0.0;
  std::size_t k = 0;
  while (k + 1 < n && speed[k + 1] <= at) ++k;
  if (k + 1 >= n || at <= speed[k]) return std::exp(log_deviation[k]);
  const double part = (at - speed[k]) / (speed[k + 1] - speed[k]);
  return std::exp(log_deviation[k] + part * (log_deviation[k + 1] - log_deviation[k]));
}

std::vector<Powers> monomials(int variables, int degree) {
  std::vector<Powers> all;
  const auto fill = [&](auto&& self, Powers powers, int from, int rest) -> void {
    if (from + 1 == variables) {
      powers[static_cast<std::size_t>(from)] = static_cast<unsigned char>(rest);
      all.push_back(powers);
      return;
    }
    for (int p = rest; p >= 0; --p) {
      powers[static_cast<std::size_t>(from)] = static_cast<unsigned char>(p);
      self(self, powers, from + 1, rest - p);
    }
  };
  for (int total = 0; total <= degree; ++total) fill(fill, {}, 0, total);
  return all;
}

double monomial(const Powers& powers, const std::array<double, most_sensors>& variables) noexcept {
  double product = 1.0;
  for (std::size_t k = 0; k < powers.size(); ++k)
    for (unsigned p = 0; p < powers[k]; ++p) product *= variables[k];
  return product;
}

Eigen::VectorXd weights_at(const WeightModel& model, const Eigen::Ref<const Eigen::VectorXd>& selectors) {
  const Eigen::Index n = model.positions + model.velocities;
  Eigen::VectorXd weights(n);
  for (Eigen::Index i = 1; i < n; ++i)
    weights(i) = std::clamp(model.weights[static_cast<std::size_t>(i - 1)](selectors), 0.0, 1.0);
  const double others = weights.tail(n - 1).sum();
  if (others > 1.0) weights.tail(n - 1) /= others;
  weights(0) = 1.0 - std::min(others, 1.0);
  return weights;
}

WeightedFusion::WeightedFusion(const WeightModel& model, const WeightLearning& learning)
    : model_{model},
      learning_{learning},
      positions_{static_cast<std::size_t>(model.positions)},
      sensors_{static_cast<std::size_t>(model.positions + model.velocities)},
      powers_{monomials(static_cast<int>(sensors_), model.polynomial.degree)},
      recursive_{sensors_} {
  INVAR_EXPECTS(model.positions >= 1 && sensors_ <= most_sensors, model.positions, model.velocities);
  model_.delays.resize(sensors_, 0.0);
  for (const numerics::RbfNetwork& network : model.weights) {
    if (network.inputs() == 2) {
      tables_.emplace_back(numerics::compile<2>(network, 2e-3, 1U << 14U).table);
    } else {
      tables_.emplace_back(numerics::compile<3>(network, 2e-3, 1U << 17U).table);
    }
  }
  reset();
}

void WeightedFusion::reset() noexcept {
  value_.fill(0.0);
  last_.fill(std::numeric_limits<double>::quiet_NaN());
  repeats_.fill(0);
  unread_.fill(0.0);
  way_.fill(0.0);
  since_.fill(0.0);
  left_.fill(false);
  jitter_.fill(0.0);
  readings_.fill(0);
  doubted_.fill(0);
  recursive_.reset();
  shift_.fill(0.0);
  intercept_shift_ = 0.0;
  step_moved_ = speed_ = spread_ = largest_ = fused_ = 0.0;
  started_ = moving_ = false;
}

void WeightedFusion::start(const FusionSample& sample) noexcept {
  for (std::size_t i = 0; i < positions_ && !started_; ++i)
    if (std::isfinite(sample.positions[i]) && (sample.silent >> i & 1U) == 0U) {
      fused_ = sample.positions[i];
      break;
    }
  value_.fill(fused_);
  started_ = true;
}

/// Whether a sensor counts with this reading: not from a leap until it has agreed with the others for some time.
bool WeightedFusion::believed(std::size_t i, bool leapt, bool agrees) noexcept {
  if (leapt || (doubted_[i] > 0 && !agrees))
    doubted_[i] = to_agree;
  else if (doubted_[i] > 0)
    --doubted_[i];
  return doubted_[i] == 0;
}

/// What a sound sensor's readings differ by at most, beside the motion, as learnt from them; infinite until they told.
double WeightedFusion::usual_change(std::size_t i, double change) noexcept {
  const double usual =
      readings_[i] < to_agree ? std::numeric_limits<double>::infinity() : 8.0 * std::sqrt(jitter_[i]);
  if (!std::isfinite(change)) return usual;
  readings_[i] = std::min(readings_[i] + 1, 100);
  const double square = readings_[i] > to_agree
                            ? std::min(change * change, 16.0 * jitter_[i])  // a leap is no noise
                            : change * change;
  jitter_[i] += (square - jitter_[i]) / readings_[i];
  return usual;
}

void WeightedFusion::read_velocity(std::size_t i, const FusionSample& sample, FusedPosition& fused) noexcept {
  const double reading = sample.velocities[i - positions_];
  unread_[i] += sample.period;
  if ((sample.silent >> i & 1U) != 0U) {  // not asked: goes with the others
    value_[i] += step_moved_;
    fused.live |= 1U << i;
    return;
  }
  repeats_[i] = reading == last_[i] ? repeats_[i] + 1 : 0;
  const double change = reading - last_[i], usual = usual_change(i, change);
  const bool sound = believed(i, std::abs(change) > usual + hardest * unread_[i],
                              std::abs(reading - speed_) < usual + 0.2 * largest_);
  if (sound && std::isfinite(reading) && repeats_[i] < 5) {
    const double before = std::isfinite(last_[i]) ? last_[i] : reading;
    const double moved = 0.5 * (reading + before) * unread_[i];
    value_[i] += moved;
    if (i == positions_) {
      const double forget = std::exp(-unread_[i] / speed_memory);
      step_moved_ = moved;
      speed_ = forget * speed_ + (1.0 - forget) * reading;
      spread_ = 0.99 * spread_ + 0.01 * std::pow(reading - before, 2);
      largest_ = std::max(largest_, std::abs(speed_));
    }
    fused.live |= 1U << i;
  } else {
    // Carried on with the fused position, so that a sensor that returns does so without a step.
    value_[i] = fused_;
  }
  unread_[i] = 0.0;
  last_[i] = reading;
}

void WeightedFusion::read_position(std::size_t i, const FusionSample& sample, FusedPosition& fused) noexcept {
  way_[i] += step_moved_;
  if (std::abs(speed_) > 0.05 * largest_) since_[i] += step_moved_;  // not what a tachometer says at rest
  if ((sample.silent >> i & 1U) != 0U) {
    value_[i] += step_moved_;
    fused.live |= 1U << i;
    return;
  }
  const double reading = sample.positions[i];
  repeats_[i] = reading == last_[i] ? repeats_[i] + 1 : 0;
  if (repeats_[i] == 0) {
    since_[i] = 0.0;
    left_[i] = false;
  }
  bool sound = std::isfinite(reading);
  if (i < model_.known.size()) {
    const PositionSensorModel& known = model_.known[i];
    const double change = reading - last_[i] - way_[i];
    const double leap = std::max({2.0 * known.step, 20.0 * known.noise, usual_change(i, change)});
    sound =
        believed(i, std::abs(change) > leap, std::abs(reading - fused_ - step_moved_) < 2.0 * leap) && sound;
    if (known.step <= 0.0 && repeats_[i] >= 5 + 3 * known.longest_repeat) sound = false;
  }
  way_[i] = 0.0;
  last_[i] = reading;
  value_[i] = reading;
  if (sound) fused.live |= 1U << i;
}

/// Fills the weights: by the selectors and what was learnt, of those that live, sum one.
void WeightedFusion::weigh(const FusionSample& sample, FusedPosition& fused) noexcept {
  const double speed = std::abs(speed_);
  double level = sample.noise_level;
  if (!std::isfinite(level)) {
    const double deviation = model_.noise.speed.empty() ? std::sqrt(0.5 * spread_) : model_.noise(speed);
    level = std::sqrt(3.0) * deviation / std::max(largest_, 1e-9);
    if (sensors_ > positions_) fused.noise[positions_] = deviation;
  }
  double others = 0.0;
  for (std::size_t i = 1; i < sensors_; ++i) {
    const double weight = tables_[i - 1].index() == 0
                              ? (*std::get_if<0>(&tables_[i - 1]))({speed, level})
                              : (*std::get_if<1>(&tables_[i - 1]))({speed, level, sample.selector});
    found_[i] = std::clamp(weight, 0.0, 1.0);
    fused.weights[i] = std::clamp(found_[i] + shift_[i], 0.0, 1.0);
    others += fused.weights[i];
  }
  fused.weights[0] = others < 1.0 ? 1.0 - others : 0.0;
  double total = 0.0;
  for (std::size_t i = 0; i < sensors_; ++i) {
    if ((fused.live >> i & 1U) == 0U) fused.weights[i] = 0.0;
    total += fused.weights[i];
  }
  if (total <= 0.0)  // what lives has no weight here: share alike
    for (std::size_t i = 0; i < sensors_; ++i)
      if ((fused.live >> i & 1U) != 0U) total += fused.weights[i] = 1.0;
  if (total > 0.0)
    for (std::size_t i = 0; i < sensors_; ++i) fused.weights[i] /= total;
}

/// The polynomial's correction; none where a sensor is missing from it.
double WeightedFusion::corrected(double mean, const FusedPosition& fused) const noexcept {
  const FusionPolynomial& p = model_.polynomial;
  if (p.degree <= 1 || fused.live != (1U << sensors_) - 1U) return mean;
  std::array<double, most_sensors> z{};
  z[0] = std::clamp((mean - p.centre) / p.reach, -1.0, 1.0);
  for (std::size_t i = 1; i < sensors_; ++i)
    z[i] = std::clamp((value_[i] - value_[0]) / p.difference_reach, -1.0, 1.0);
  double sum = 0.0;
  for (std::size_t k = 0; k < powers_.size(); ++k)
    sum += p.coefficients(static_cast<Eigen::Index>(k)) * monomial(powers_[k], z);
  return mean + sum;
}

/// Its position now: on by its delay and its reading's age.
double WeightedFusion::aligned(std::size_t i, const FusionSample& sample) const noexcept {
  return value_[i] + (model_.delays[i] + sample.ages[i]) * speed_;
}

/// What the weights in use leave is learnt as a further shift of them, a little of it at each sample.
void WeightedFusion::learn(const FusionSample& sample, const FusedPosition& fused) noexcept {
  if (learning_.memory <= 0.0 || !std::isfinite(sample.reference) || fused.live != (1U << sensors_) - 1U)
    return;
  Values at{};
  for (std::size_t i = 0; i < sensors_; ++i) at[i] = aligned(i, sample);
  double mean = at[0];  // by the model's own weights: the shift in use is no part of what is learnt
  for (std::size_t i = 1; i < sensors_; ++i) mean += found_[i] * (at[i] - at[0]);
  const double share = std::min(1.0, sample.period / learning_.memory);
  recursive_.add(at, at[0] + sample.reference - model_.intercept - mean, 1.0 - share);
  const auto ease = [share](double& from, double to, double most) {
    from += share * (std::clamp(to, -most, most) - from);
  };
  for (std::size_t i = 1; i < sensors_; ++i) ease(shift_[i], recursive_.weight(i), learning_.most);
  ease(intercept_shift_, recursive_.intercept(), learning_.most_intercept);
}

FusedPosition WeightedFusion::step(const FusionSample& sample) noexcept {
  if (!started_) start(sample);
  FusedPosition fused;
  step_moved_ = speed_ * sample.period;  // where no velocity sensor says better
  for (std::size_t i = positions_; i < sensors_; ++i) read_velocity(i, sample, fused);
  for (std::size_t i = 0; i < positions_; ++i) read_position(i, sample, fused);
  // A position that stands still while the velocity has moved on by far more than it steps: stuck, until it counts again. The
  // true position may pass the stuck one meanwhile.
  const bool witnessed = sensors_ > positions_ && (fused.live >> positions_ & 1U) != 0U;
  for (std::size_t i = 0; i < positions_; ++i) {
    const bool stepped = i < model_.known.size() && model_.known[i].step > 0.0;
    left_[i] |=
        witnessed && repeats_[i] > 0 && std::abs(since_[i]) > (stepped ? 3.0 * model_.known[i].step : 0.005);
    if (left_[i]) fused.live &= ~(1U << i);
  }
  weigh(sample, fused);

  double mean = 0.0;
  double total = 0.0;
  for (std::size_t i = 0; i < sensors_; ++i) {
    fused.lateness[i] = model_.delays[i];
    if (fused.weights[i] <= 0.0) continue;
    total += fused.weights[i];
    mean += fused.weights[i] * aligned(i, sample);
  }
  if (total > 0.0) {
    const double before = std::exchange(fused_, corrected(mean, fused) + model_.intercept + intercept_shift_);
    const bool tachometer = sensors_ > positions_ && (fused.live >> positions_ & 1U) != 0U;
    if (!tachometer && moving_ && sample.period > 0.0) {  // speed from the position itself
      const double forget = std::exp(-sample.period / speed_memory);
      speed_ = forget * speed_ + (1.0 - forget) * (fused_ - before) / sample.period;
      largest_ = std::max(largest_, std::abs(speed_));
    }
    moving_ = true;
  }
  learn(sample, fused);
  fused.position = fused_;
  fused.velocity = speed_;
  fused.sigma = std::numeric_limits<double>::quiet_NaN();  // the method does not know
  return fused;
}

}  // namespace invar::metrology
