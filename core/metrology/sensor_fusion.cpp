#include "core/metrology/sensor_fusion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {

// Spectral densities of jerk [m2/s5]: cruising, a servo's sinusoids, hard starts and stops.
constexpr std::array<double, 3> jerk_density{0.02, 5.0, 2000.0};
constexpr double switching_rate = 4.0;      // changes of mode per second
constexpr double gain_sigma = 0.005;        // of the velocity sensor's gain since calibration
constexpr double gain_walk = 1e-8;          // [1/s]
constexpr double information_memory = 0.1;  // [s]
constexpr double surprise = 1e-7;           // probability below which a reading is not believed
constexpr double stuck_conflict = 16.0;     // log odds against a reading that stands still
constexpr int odd_limit = 5;
constexpr int good_limit = 20;

double normal_density(double z) noexcept {
  return std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi);
}

/// P(z > at) without loss of digits in the tail.
double beyond(double at) noexcept { return 0.5 * std::erfc(at / std::numbers::sqrt2); }

/// Moments of a normal (0, 1) cut to [low, high].
struct Cut {
  double probability;
  double mean;
  double variance;
};

/// The most that a cell of this width could ever hold: what its probability is to be compared with.
double most_probable(double low, double high) noexcept { return 1.0 - 2.0 * beyond(0.5 * (high - low)); }

Cut cut(double low, double high) noexcept {
  if (low > 0.0) {  // mirror, so that differences are taken in the tail that has digits
    const Cut mirrored = cut(-high, -low);
    return {mirrored.probability, -mirrored.mean, mirrored.variance};
  }
  const double p = high < 0.0 ? beyond(-high) - beyond(-low) : 1.0 - beyond(-low) - beyond(high);
  if (p < 1e-12) {  // all of it beyond the nearer bound
    const double near = std::abs(low) < std::abs(high) ? low : high;
    return {std::max(p, 1e-300), near, 1e-3};
  }
  const double a = normal_density(low);
  const double b = normal_density(high);
  const double mean = (a - b) / p;
  const double variance = 1.0 + (low * a - high * b) / p - mean * mean;
  return {p, mean, std::clamp(variance, 1e-6, 1.0)};
}

/// Kalman update of `mean`, `covariance` by a scalar y = row . state whose distribution changes from
/// N(m, s^2) to one of mean m + shift and variance keep * s^2. Returns the information gained [nats].
double apply(Eigen::Vector4d& mean, Eigen::Matrix4d& covariance, const Eigen::Vector4d& row, double variance,
             double shift, double keep) noexcept {
  const Eigen::Vector4d gain = covariance * row / variance;
  mean += gain * shift;
  covariance -= gain * gain.transpose() * (variance * (1.0 - keep));
  covariance = 0.5 * (covariance + covariance.transpose()).eval();
  return -0.5 * std::log(std::max(keep, 1e-6));
}

}  // namespace

double VelocitySensorModel::response(double v) const noexcept {
  const double size = std::abs(v);
  const double at = std::min(size, fastest);
  double sum = at * (gains[0] + at * (gains[1] + at * (gains[2] + at * gains[3])));
  if (size > fastest) sum += (size - fastest) * sensitivity(fastest);
  return v < 0.0 ? -sum : sum;
}

double VelocitySensorModel::sensitivity(double v) const noexcept {
  const double at = std::min(std::abs(v), fastest);
  return gains[0] + at * (2.0 * gains[1] + at * (3.0 * gains[2] + at * 4.0 * gains[3]));
}

FusionObserver::FusionObserver(const FusionModel& model) : model_{model} {
  INVAR_EXPECTS(model.positions.size() <= most_sensors && model.velocities.size() <= most_sensors,
                model.positions.size(), model.velocities.size());
  reset();
}

void FusionObserver::reset() noexcept {
  position_memory_.fill({});
  velocity_memory_.fill({});
  information_.fill(0.0);
  steps_ = 0;
  started_ = false;
}

void FusionObserver::start(const FusionSample& sample) noexcept {
  double x = 0.0;
  double sigma = 1e3;
  for (std::size_t i = 0; i < model_.positions.size(); ++i) {
    if (!std::isfinite(sample.positions[i])) continue;
    const PositionSensorModel& sensor = model_.positions[i];
    x = sample.positions[i] + (i == 0 ? model_.start_offset : sensor.offset);
    sigma = i == 0 ? model_.start_sigma : std::hypot(sensor.step / std::sqrt(12.0), sensor.noise);
    break;
  }
  for (Mode& mode : modes_) {
    mode.mean << x, 0.0, 0.0, 0.0;
    mode.covariance = Covariance::Zero();
    mode.covariance.diagonal() << sigma * sigma, 1e-6, 1e-2, gain_sigma * gain_sigma;
    mode.probability = 1.0 / models;
  }
  started_ = true;
}

FusionObserver::State FusionObserver::mean() const noexcept {
  State sum = State::Zero();
  for (const Mode& mode : modes_) sum += mode.probability * mode.mean;
  return sum;
}

/// Interaction of the models: each starts the period from a mixture of all.
void FusionObserver::mix() noexcept {
  const auto before = modes_;
  std::array<double, models> total{};
  const auto& change = switching_;
  for (std::size_t j = 0; j < models; ++j)
    for (std::size_t i = 0; i < models; ++i)
      total[j] += (i == j ? 1.0 - change : change / (models - 1)) * before[i].probability;
  for (std::size_t j = 0; j < models; ++j) {
    Mode& mode = modes_[j];
    mode.mean.setZero();
    mode.covariance.setZero();
    std::array<double, models> share{};
    for (std::size_t i = 0; i < models; ++i) {
      share[i] = (i == j ? 1.0 - change : change / (models - 1)) * before[i].probability / total[j];
      mode.mean += share[i] * before[i].mean;
    }
    for (std::size_t i = 0; i < models; ++i) {
      const State apart = before[i].mean - mode.mean;
      mode.covariance += share[i] * (before[i].covariance + apart * apart.transpose());
    }
    mode.probability = total[j];
  }
}

void FusionObserver::predict(double dt) noexcept {
  Covariance transition = Covariance::Identity();
  transition(0, 1) = transition(1, 2) = dt;
  transition(0, 2) = 0.5 * dt * dt;
  Covariance noise = Covariance::Zero();
  noise.topLeftCorner<3, 3>() << std::pow(dt, 5) / 20.0, std::pow(dt, 4) / 8.0, std::pow(dt, 3) / 6.0,
      std::pow(dt, 4) / 8.0, std::pow(dt, 3) / 3.0, dt * dt / 2.0, std::pow(dt, 3) / 6.0, dt * dt / 2.0, dt;
  for (std::size_t j = 0; j < models; ++j) {
    Mode& mode = modes_[j];
    mode.mean = transition * mode.mean;
    mode.covariance = transition * mode.covariance * transition.transpose() + jerk_density[j] * noise;
    mode.covariance(3, 3) += gain_walk * dt;
  }
}

void FusionObserver::renormalise(const std::array<double, models>& likelihood) noexcept {
  double total = 0.0;
  for (std::size_t j = 0; j < models; ++j) {
    modes_[j].probability *= std::max(likelihood[j], 1e-30);
    total += modes_[j].probability;
  }
  double floored = 0.0;
  for (Mode& mode : modes_) {
    mode.probability = std::max(mode.probability / total, 1e-6);
    floored += mode.probability;
  }
  for (Mode& mode : modes_) mode.probability /= floored;
}

void FusionObserver::advance(double period) noexcept {
  if (period <= 0.0) return;
  switching_ = std::min(0.3, switching_rate * period);
  mix();
  predict(period);
}

void FusionObserver::use_velocity(std::size_t i, double reading) noexcept {
  const VelocitySensorModel& sensor = model_.velocities[i];
  VelocityMemory& memory = velocity_memory_[i];
  if (!std::isfinite(reading)) {
    memory.faulty = true;  // it must prove itself again
    memory.good = good_limit - 2;
    return;
  }
  const double noise = memory.variance * sensor.correlation * sensor.correlation;
  std::array<double, models> likelihood{};
  std::array<State, models> rows;
  std::array<double, models> innovation{};
  std::array<double, models> variance{};
  double least = 1e9;
  for (std::size_t j = 0; j < models; ++j) {
    const Mode& mode = modes_[j];
    const double v = mode.mean(1) - sensor.lag * mode.mean(2);
    const double gain = i == 0 ? 1.0 + mode.mean(3) : 1.0;
    const double slope = gain * sensor.sensitivity(v);
    const double response = sensor.response(v);
    rows[j] << 0.0, slope, -sensor.lag * slope, i == 0 ? response : 0.0;
    innovation[j] = reading - sensor.offset - gain * response;
    variance[j] = rows[j].dot(mode.covariance * rows[j]) + noise;
    const double z = innovation[j] / std::sqrt(variance[j]);
    likelihood[j] = normal_density(std::min(std::abs(z), 8.0)) / std::sqrt(variance[j]);
    least = std::min(least, std::abs(z));
  }
  const bool odd = least > 5.5;
  memory.odd = odd ? memory.odd + 1 : 0;
  memory.good = odd || memory.dead ? 0 : memory.good + 1;
  if (memory.dead || memory.odd >= odd_limit) memory.faulty = true;
  if (memory.faulty && memory.good >= good_limit) memory.faulty = false;
  if (memory.faulty || odd) return;
  double information = 0.0;
  for (std::size_t j = 0; j < models; ++j) {
    Mode& mode = modes_[j];
    const double state_variance = variance[j] - noise;
    // The scalar row . state: its variance shrinks to noise / (noise + its own) of what it was.
    information +=
        mode.probability * apply(mode.mean, mode.covariance, rows[j], state_variance,
                                 innovation[j] * state_variance / variance[j], noise / variance[j]);
  }
  information_[most_sensors + i] += information;
  renormalise(likelihood);
}

void FusionObserver::use_position(std::size_t i, double reading) noexcept {
  const PositionSensorModel& sensor = model_.positions[i];
  PositionMemory& memory = position_memory_[i];
  if (!std::isfinite(reading)) {
    memory.faulty = true;
    memory.good = good_limit - 2;
    return;
  }
  const bool moved = reading != memory.last && std::isfinite(memory.last);
  memory.last = reading;
  std::array<State, models> rows;
  std::array<Cut, models> cuts;
  std::array<double, models> deviation{};
  std::array<double, models> edge{};
  double probability = 0.0;
  for (std::size_t j = 0; j < models; ++j) {
    const Mode& mode = modes_[j];
    rows[j] << 1.0, -sensor.delay, 0.0, 0.0;
    const double sign = mode.mean(1) > 0.0 ? 1.0 : (mode.mean(1) < 0.0 ? -1.0 : 0.0);
    const double expected = rows[j].dot(mode.mean) - sensor.offset - sign * sensor.hysteresis;
    edge[j] = std::max(rows[j].dot(mode.covariance * rows[j]), 1e-18);
    const double noise = std::max(sensor.noise, 1e-7);
    deviation[j] = std::sqrt(edge[j] + noise * noise);
    if (sensor.step > 0.0) {
      cuts[j] = cut((reading - 0.5 * sensor.step - expected) / deviation[j],
                    (reading + 0.5 * sensor.step - expected) / deviation[j]);
    } else {
      const double z = (reading - expected) / deviation[j];
      cuts[j] = {std::exp(-0.5 * z * z), z, 0.0};  // state and noise together are known exactly
    }
    const double width = sensor.step / deviation[j];
    probability += mode.probability * cuts[j].probability /
                   (sensor.step > 0.0 ? std::max(most_probable(0.0, width), 1e-12) : 1.0);
  }
  // A reading that stands still while the rest moves on is refuted little by little; an edge clears it.
  const bool odd = probability < surprise;
  if (moved && !odd) memory.conflict = memory.pulled = 0.0;
  if (moved) memory.travel = memory.travel_variance = 0.0;
  memory.conflict = std::max(
      0.0, memory.conflict - std::log(std::max(probability, 1e-30)) - (sensor.step > 0.0 ? 0.3 : 2.0));
  if (memory.conflict <= 0.0) memory.pulled = 0.0;
  memory.odd = odd ? memory.odd + 1 : 0;
  memory.good = odd || probability < 1e-3 ? 0 : memory.good + 1;
  if (alone(i) && !(memory.faulty && !moved) && (memory.odd >= 2 || memory.conflict > stuck_conflict)) {
    restart_at(sensor, reading);
    memory.faulty = false;
    memory.odd = 0;
    memory.conflict = memory.pulled = 0.0;
    return;
  }
  if (memory.odd >= odd_limit)
    for (std::size_t k = 0; k < model_.positions.size(); ++k)
      if (k != i && !position_memory_[k].faulty && outlived(k, i, reading)) {
        position_memory_[k].faulty = true;  // it stood still while this one moved on
        position_memory_[k].good = 0;
        memory.faulty = false;
        memory.odd = 0;
        memory.conflict = memory.pulled = 0.0;
        restart_at(sensor, reading);
        return;
      }
  if (!memory.faulty && memory.odd >= odd_limit && !refuted_jump(i, reading)) {
    restart_at(sensor, reading);  // nobody contradicts the sensor: it is the estimate that was lost
    memory.odd = 0;
    memory.conflict = memory.pulled = 0.0;
    return;
  }
  if (!memory.faulty &&
      (memory.odd >= odd_limit || (!moved && memory.conflict > stuck_conflict && refuted_standing(i)))) {
    memory.faulty = true;
    for (Mode& mode : modes_) {
      mode.mean(0) -= memory.pulled;  // what the stuck reading held back
      mode.covariance(0, 0) += memory.pulled * memory.pulled * 0.05;
    }
  }
  if (memory.faulty && memory.good >= good_limit && memory.conflict <= 0.0) memory.faulty = false;
  if (memory.faulty || odd) return;
  memory.believed = reading;
  memory.since = memory.since_variance = 0.0;
  double information = 0.0;
  double moved_by = 0.0;
  std::array<double, models> likelihood{};
  for (std::size_t j = 0; j < models; ++j) {
    Mode& mode = modes_[j];
    const double ratio =
        edge[j] / (deviation[j] * deviation[j]);  // the state's share of the scalar's variance
    const double before = mode.mean(0);
    const double keep = 1.0 - (1.0 - cuts[j].variance) * ratio;
    information += mode.probability * apply(mode.mean, mode.covariance, rows[j], edge[j],
                                            cuts[j].mean * deviation[j] * ratio, keep);
    moved_by += mode.probability * (mode.mean(0) - before);
    likelihood[j] = sensor.step > 0.0 ? cuts[j].probability : cuts[j].probability / deviation[j];
  }
  if (memory.conflict > 0.0) memory.pulled += moved_by;
  information_[i] += information;
  renormalise(likelihood);
}

FusedPosition FusionObserver::step(const FusionSample& sample) noexcept {
  const std::size_t positions = model_.positions.size();
  const std::size_t velocities = model_.velocities.size();
  if (!started_) start(sample);
  learn_noise(sample);
  add_travel(sample);
  watch_for_dead(sample);
  advance(sample.period);
  const double forget = std::exp(-sample.period / information_memory);
  for (double& value : information_) value *= forget;
  past_[steps_ % history] = {modes_, sample};
  ++steps_;
  for (std::size_t i = 0; i < velocities; ++i) use_velocity(i, sample.velocities[i]);
  for (std::size_t i = 0; i < positions; ++i) use_position(i, sample.positions[i]);

  FusedPosition fused;
  const State state = mean();
  fused.position = state(0);
  fused.velocity = state(1);
  double variance = 0.0;
  for (const Mode& mode : modes_)
    variance += mode.probability * (mode.covariance(0, 0) + std::pow(mode.mean(0) - state(0), 2));
  fused.sigma = std::sqrt(variance);
  double total = 0.0;
  const auto share = [&](std::size_t from, std::size_t to, bool faulty) {
    if (faulty) {
      information_[from] = 0.0;
      return;
    }
    fused.live |= 1U << to;
    fused.weights[to] = information_[from];
    total += information_[from];
  };
  for (std::size_t i = 0; i < positions; ++i) share(i, i, position_memory_[i].faulty);
  for (std::size_t i = 0; i < velocities; ++i)
    share(most_sensors + i, positions + i, velocity_memory_[i].faulty);
  if (total > 0.0) {
    for (double& weight : fused.weights) weight /= total;
  } else if (positions > 0 && !position_memory_[0].faulty) {
    fused.weights[0] = 1.0;  // nothing moved yet: the start came from the first position sensor
  }
  return fused;
}

}  // namespace invar::metrology
