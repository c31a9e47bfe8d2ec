#include "core/metrology/fusion/fusion_observer.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {

// Spectral densities of jerk [m2/s5]: cruising, a servo's sinusoids, hard starts and stops.
constexpr std::array<double, 3> jerk_density{0.02, 5.0, 2000.0};
constexpr double switching_rate = 4.0;  // changes of mode per second
// What a sensor may drift while it works, in a minute, as part of what it was uncertain by at first.
constexpr double drift_minute = 60.0;
constexpr double offset_part =
    2e-3;  // of a velocity sensor's largest reading: its offset's uncertainty and drift
constexpr double cell_part = 0.02;          // of a position sensor's step or noise: likewise
constexpr double lateness_drift = 2e-4;     // [s]
constexpr double information_memory = 0.1;  // [s]

}  // namespace

FusionObserver::FusionObserver(const FusionModel& model)
    : model_{model}, positions_{model.positions.size()}, velocities_{model.velocities.size()} {
  INVAR_EXPECTS(positions_ >= 1 && positions_ + velocities_ <= most_sensors, positions_, velocities_);
  states_ = gain_of_velocity(velocities_);
  drift_ = State::Zero(states_);
  const auto walk = [](double in_a_minute) { return in_a_minute * in_a_minute / drift_minute; };
  for (std::size_t i = 1; i < positions_; ++i) {
    const PositionSensorModel& sensor = model_.positions[i];
    drift_(offset_of_position(i)) = walk(cell_part * std::max(sensor.step, sensor.noise));
    drift_(offset_of_position(i) + 1) = walk(lateness_drift);
  }
  for (std::size_t i = 0; i < velocities_; ++i) {
    drift_(gain_of_velocity(i)) = std::pow(model_.velocities[i].gain_drift, 2);
    drift_(gain_of_velocity(i) + 1) = walk(offset_part * model_.velocities[i].largest);
    drift_(gain_of_velocity(i) + 2) = walk(lateness_drift);
  }
  reset();
}

void FusionObserver::reset() noexcept {
  position_memory_.fill({});
  velocity_memory_.fill({});
  information_.fill(0.0);
  steps_ = 0;
  doubt_ = 0.0;
  for (const VelocitySensorModel& sensor : model_.velocities)
    doubt_ = std::max(doubt_, std::min(10.0 * sensor.gain_sigma, most_doubt));
  started_ = false;
}

void FusionObserver::start(const FusionSample& sample) noexcept {
  double x = 0.0;
  double sigma = 1e3;
  for (std::size_t i = 0; i < positions_; ++i) {
    if (!std::isfinite(sample.positions[i]) || silent(sample, i)) continue;
    const PositionSensorModel& sensor = model_.positions[i];
    x = sample.positions[i] + (i == 0 ? model_.start_offset : sensor.offset);
    sigma = i == 0 ? model_.start_sigma : std::hypot(sensor.step / std::sqrt(12.0), sensor.noise);
    break;
  }
  State deviation = State::Zero(states_);
  deviation.head<3>() << sigma, 1e-3, 0.1;
  for (std::size_t i = 1; i < positions_; ++i) {
    const PositionSensorModel& sensor = model_.positions[i];
    deviation(offset_of_position(i)) = cell_part * std::max(sensor.step, sensor.noise);
    deviation(offset_of_position(i) + 1) = sensor.delay_sigma;
  }
  for (std::size_t i = 0; i < velocities_; ++i) {
    const VelocitySensorModel& sensor = model_.velocities[i];
    deviation(gain_of_velocity(i)) = sensor.gain_sigma;
    deviation(gain_of_velocity(i) + 1) = offset_part * sensor.largest;
    deviation(gain_of_velocity(i) + 2) = sensor.lag_sigma;
  }
  for (Mode& mode : modes_) {
    mode.mean = State::Zero(states_);
    mode.mean(0) = x;
    mode.covariance = Covariance::Zero(states_, states_);
    mode.covariance.diagonal() = deviation.cwiseAbs2();
    mode.probability = 1.0 / models;
  }
  unheld_ = modes_;
  settled_at_ = x;
  started_ = true;
}

FusionObserver::State FusionObserver::mean(const Estimate& modes) const noexcept {
  State sum = State::Zero(states_);
  for (const Mode& mode : modes) sum += mode.probability * mode.mean;
  return sum;
}

/// Mean square distance of the position from `about` [m2].
double FusionObserver::variance(const Estimate& modes, double about) noexcept {
  double sum = 0.0;
  for (const Mode& mode : modes)
    sum += mode.probability * (mode.covariance(0, 0) + std::pow(mode.mean(0) - about, 2));
  return sum;
}

/// Interaction of the models: each starts the period from a mixture of all.
void FusionObserver::mix(Estimate& modes) const noexcept {
  const Estimate before = modes;
  std::array<double, models> total{};
  const auto& change = switching_;
  for (std::size_t j = 0; j < models; ++j)
    for (std::size_t i = 0; i < models; ++i)
      total[j] += (i == j ? 1.0 - change : change / (models - 1)) * before[i].probability;
  for (std::size_t j = 0; j < models; ++j) {
    Mode& mode = modes[j];
    mode.mean.setZero();
    mode.covariance.setZero();
    std::array<double, models> share{};
    for (std::size_t i = 0; i < models; ++i) {
      share[i] = (i == j ? 1.0 - change : change / (models - 1)) * before[i].probability / total[j];
      mode.mean += share[i] * before[i].mean;
    }
    for (std::size_t i = 0; i < models; ++i) {
      const State apart = before[i].mean - mode.mean;
      for (Eigen::Index k = 0; k < states_; ++k)
        mode.covariance.col(k) += share[i] * (before[i].covariance.col(k) + apart * apart(k));
    }
    mode.probability = total[j];
  }
}

void FusionObserver::predict(Estimate& modes, double dt) const noexcept {
  Eigen::Matrix3d transition;
  transition << 1.0, dt, 0.5 * dt * dt, 0.0, 1.0, dt, 0.0, 0.0, 1.0;
  Eigen::Matrix3d noise;
  noise << std::pow(dt, 5) / 20.0, std::pow(dt, 4) / 8.0, std::pow(dt, 3) / 6.0, std::pow(dt, 4) / 8.0,
      std::pow(dt, 3) / 3.0, dt * dt / 2.0, std::pow(dt, 3) / 6.0, dt * dt / 2.0, dt;
  for (std::size_t j = 0; j < models; ++j) {
    Mode& mode = modes[j];
    const Eigen::Vector3d motion = transition * mode.mean.head<3>();
    mode.mean.head<3>() = motion;
    Eigen::Matrix3d own = transition * mode.covariance.topLeftCorner<3, 3>() * transition.transpose();
    own += jerk_density[j] * noise;
    mode.covariance.topLeftCorner<3, 3>() = 0.5 * (own + own.transpose());
    for (Eigen::Index k = 3; k < states_; ++k) {
      const Eigen::Vector3d cross = transition * mode.covariance.col(k).head<3>();
      mode.covariance.col(k).head<3>() = cross;
      mode.covariance.row(k).head<3>() = cross.transpose();
      mode.covariance(k, k) += drift_(k) * dt;
    }
  }
}

void FusionObserver::renormalise(Estimate& modes, const std::array<double, models>& likelihood) noexcept {
  double total = 0.0;
  for (std::size_t j = 0; j < models; ++j) {
    modes[j].probability *= std::max(likelihood[j], 1e-30);
    total += modes[j].probability;
  }
  double floored = 0.0;
  for (Mode& mode : modes) {
    mode.probability = std::max(mode.probability / total, 1e-6);
    floored += mode.probability;
  }
  for (Mode& mode : modes) mode.probability /= floored;
}

void FusionObserver::advance(double period) noexcept {
  if (period <= 0.0) return;
  switching_ = std::min(0.3, switching_rate * period);
  for (Estimate* modes : {&modes_, &unheld_}) {
    mix(*modes);
    predict(*modes, period);
  }
}

FusedPosition FusionObserver::step(const FusionSample& sample) noexcept {
  if (!started_) start(sample);
  learn_noise(sample);
  add_travel(sample);
  watch_for_dead(sample);
  advance(sample.period);
  const double forget = std::exp(-sample.period / information_memory);
  for (double& value : information_) value *= forget;
  past_[steps_ % history] = {modes_, sample};
  ++steps_;
  for (std::size_t i = 0; i < velocities_; ++i) use_velocity(i, sample);
  for (std::size_t i = 0; i < positions_; ++i) use_position(i, sample);
  settle();

  FusedPosition fused;
  const double stuck = unheld_weight();
  const State state = (1.0 - stuck) * mean(modes_) + stuck * mean(unheld_);
  fused.position = state(0);
  fused.velocity = state(1);
  fused.sigma = std::sqrt((1.0 - stuck) * variance(modes_, state(0)) + stuck * variance(unheld_, state(0)));
  double total = 0.0;
  const auto share = [&](std::size_t sensor, bool faulty) {
    if (faulty) {
      information_[sensor] = 0.0;
      return;
    }
    fused.live |= 1U << sensor;
    fused.weights[sensor] = information_[sensor];
    total += information_[sensor];
  };
  for (std::size_t i = 0; i < positions_; ++i) {
    share(i, position_memory_[i].faulty);
    fused.lateness[i] = position_delay(i, state);
  }
  for (std::size_t i = 0; i < velocities_; ++i) {
    share(positions_ + i, velocity_memory_[i].faulty);
    fused.lateness[positions_ + i] = velocity_lag(i, state);
    fused.noise[positions_ + i] = std::sqrt(velocity_memory_[i].variance);
  }
  if (total > 0.0) {
    for (double& weight : fused.weights) weight /= total;
  } else if (!position_memory_[0].faulty) {
    fused.weights[0] = 1.0;  // nothing moved yet: the start came from the first position sensor
  }
  return fused;
}

}  // namespace invar::metrology
