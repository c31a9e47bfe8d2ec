// What one reading does to the estimate: a velocity as a Kalman update, a position by the cell that it stands for.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/metrology/fusion_observer.hpp"

namespace invar::metrology {

namespace {

constexpr double surprise = 1e-7;        // probability below which a reading is not believed
constexpr double doubtful = 1e-3;        // probability below which a reading proves nothing for its sensor
constexpr double stuck_conflict = 16.0;  // log odds against a reading that stands still
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

/// Kalman update of `mean`, `covariance` by a scalar y = row . state, `gain` = covariance . row, whose distribution
/// changes from N(m, s^2) to one of mean m + shift and variance keep * s^2. Returns the information gained [nats].
template <class State, class Covariance>
double apply(State& mean, Covariance& covariance, const State& gain, double variance, double shift,
             double keep) noexcept {
  mean += gain * (shift / variance);
  const double shrink = (1.0 - keep) / variance;
  for (Eigen::Index k = 0; k < mean.size(); ++k) covariance.col(k) -= gain * (gain(k) * shrink);
  return -0.5 * std::log(std::max(keep, 1e-6));
}

}  // namespace

double FusionObserver::Row::dot(const State& state) const noexcept {
  double sum = 0.0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(size); ++k) sum += value[k] * state(at[k]);
  return sum;
}

FusionObserver::State FusionObserver::Row::times(const Covariance& covariance) const noexcept {
  State sum = State::Zero(covariance.rows());
  for (std::size_t k = 0; k < static_cast<std::size_t>(size); ++k) sum += value[k] * covariance.col(at[k]);
  return sum;
}

double FusionObserver::position_delay(std::size_t i, const State& state) const noexcept {
  return model_.positions[i].delay + (i > 0 ? state(offset_of_position(i) + 1) : 0.0);
}

double FusionObserver::velocity_lag(std::size_t i, const State& state) const noexcept {
  return model_.velocities[i].lag + state(gain_of_velocity(i) + 2);
}

void FusionObserver::use_velocity(std::size_t i, const FusionSample& sample) noexcept {
  if (silent(sample, positions_ + i)) return;
  const VelocitySensorModel& sensor = model_.velocities[i];
  VelocityMemory& memory = velocity_memory_[i];
  const double reading = sample.velocities[i];
  if (!std::isfinite(reading)) {
    memory.faulty = true;  // it must prove itself again
    memory.good = good_limit - 2;
    return;
  }
  const double noise = memory.variance * sensor.correlation * sensor.correlation;
  std::array<double, models> likelihood{};
  std::array<State, models> gains;
  std::array<double, models> innovation{};
  std::array<double, models> variance{};
  double least = 1e9;
  for (std::size_t j = 0; j < models; ++j) {
    const Mode& mode = modes_[j];
    const Eigen::Index own = gain_of_velocity(i);
    const double lag = velocity_lag(i, mode.mean) + sample.ages[positions_ + i];
    const double v = mode.mean(1) - lag * mode.mean(2);
    const double gain = 1.0 + mode.mean(own);
    const double slope = gain * sensor.sensitivity(v);
    const double response = sensor.response(v);
    Row row;
    row.add(1, slope);
    row.add(2, -lag * slope);
    row.add(own, response);
    row.add(own + 1, 1.0);
    row.add(own + 2, -mode.mean(2) * slope);
    innovation[j] = reading - sensor.offset - mode.mean(own + 1) - gain * response;
    gains[j] = row.times(mode.covariance);
    variance[j] = row.dot(gains[j]) + noise;
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
        mode.probability * apply(mode.mean, mode.covariance, gains[j], state_variance,
                                 innovation[j] * state_variance / variance[j], noise / variance[j]);
  }
  information_[positions_ + i] += information;
  renormalise(likelihood);
}

void FusionObserver::use_position(std::size_t i, const FusionSample& sample) noexcept {
  if (silent(sample, i)) return;
  const PositionSensorModel& sensor = model_.positions[i];
  PositionMemory& memory = position_memory_[i];
  const double reading = sample.positions[i];
  if (!std::isfinite(reading)) {
    memory.faulty = true;
    memory.good = good_limit - 2;
    return;
  }
  const bool moved = reading != memory.last && std::isfinite(memory.last);
  if (moved) see_change(i, reading, sample.period);
  if (moved) memory.left = false;
  if (!moved && memory.faulty && sensor.step > 0.0 && stood_still(i, sample)) memory.left = true;
  memory.last = reading;
  std::array<State, models> gains;
  std::array<Cut, models> cuts;
  std::array<double, models> deviation{};
  std::array<double, models> edge{};
  double probability = 0.0;
  for (std::size_t j = 0; j < models; ++j) {
    const Mode& mode = modes_[j];
    const double delay = position_delay(i, mode.mean) + sample.ages[i];
    const double then = mode.mean(1) - delay * mode.mean(2);  // velocity when it was read
    Row row;
    row.add(0, 1.0);
    row.add(1, -delay);
    row.add(2, 0.5 * delay * delay);
    if (i > 0) {
      row.add(offset_of_position(i), -1.0);
      row.add(offset_of_position(i) + 1, -then);
    }
    const double sign = mode.mean(1) > 0.0 ? 1.0 : (mode.mean(1) < 0.0 ? -1.0 : 0.0);
    const double expected = mode.mean(0) - 0.5 * delay * (mode.mean(1) + then) - sensor.offset -
                            (i > 0 ? mode.mean(offset_of_position(i)) : 0.0) - sign * sensor.hysteresis;
    gains[j] = row.times(mode.covariance);
    edge[j] = std::max(row.dot(gains[j]), 1e-18);
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
  if (moved && !odd) memory.conflict = 0.0;
  if (moved) memory.travel = memory.travel_variance = 0.0;
  memory.conflict = std::clamp(
      memory.conflict - std::log(std::max(probability, 1e-30)) - (sensor.step > 0.0 ? 0.3 : 2.0), 0.0,
      2.0 * stuck_conflict);  // no more, so that a sensor can live it down
  if (memory.conflict <= 0.0 || moved) agree(i);
  memory.odd = odd ? memory.odd + 1 : 0;
  memory.good = odd || probability < doubtful ? 0 : memory.good + 1;
  if (alone(i) && !(memory.faulty && !moved) && (memory.odd >= 2 || memory.conflict > stuck_conflict)) {
    restart_at(i, reading);
    return;
  }
  if (memory.odd >= odd_limit)
    for (std::size_t k = 0; k < positions_; ++k)
      if (k != i && !position_memory_[k].faulty && outlived(k, i, reading)) {
        position_memory_[k].faulty = true;  // it stood still while this one moved on
        position_memory_[k].good = 0;
        restart_at(i, reading);
        return;
      }
  // Nobody contradicts the sensor: it is the estimate that was lost.
  const bool stuck = !moved && sensor.step > 0.0 && travelled_on(i);
  if (!memory.faulty && memory.odd >= odd_limit && !stuck && !refuted_jump(i)) {
    restart_at(i, reading);
    return;
  }
  if (memory.faulty && moved && counts_on(i, reading)) {
    if (probability < doubtful) {
      restart_at(i, reading);
      return;
    }
    memory.faulty = false;
    memory.conflict = 0.0;
  }
  if (!memory.faulty &&
      (memory.odd >= odd_limit || (!moved && memory.conflict > stuck_conflict && refuted_standing(i)))) {
    memory.faulty = true;
    memory.from = reading;
    if (!moved && sensor.step > 0.0 && travelled_on(i)) go_on_without(i, sample);
  }
  if (memory.faulty && !memory.left && memory.good >= good_limit && memory.conflict <= 0.0)
    memory.faulty = false;
  if (memory.faulty || odd) return;
  memory.leapt = 0.0;
  double information = 0.0;
  std::array<double, models> likelihood{};
  for (std::size_t j = 0; j < models; ++j) {
    Mode& mode = modes_[j];
    const double ratio =
        edge[j] / (deviation[j] * deviation[j]);  // the state's share of the scalar's variance
    const double keep = 1.0 - (1.0 - cuts[j].variance) * ratio;
    information += mode.probability * apply(mode.mean, mode.covariance, gains[j], edge[j],
                                            cuts[j].mean * deviation[j] * ratio, keep);
    likelihood[j] = sensor.step > 0.0 ? cuts[j].probability : cuts[j].probability / deviation[j];
  }
  information_[i] += information;
  renormalise(likelihood);
  if (moved) counted_ = modes_;
}

}  // namespace invar::metrology
