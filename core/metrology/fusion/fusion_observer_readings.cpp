// What one reading does to the estimate: a velocity as a Kalman update, a position by the cell that it stands for.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/metrology/fusion/fusion_observer.hpp"

namespace invar::metrology {

namespace {

constexpr double surprise = 1e-7;        // probability below which a reading is not believed
constexpr double doubtful = 1e-3;        // probability below which a reading proves nothing for its sensor
constexpr double odd_velocity = 4e-8;    // 5.5 deviations
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

/// Kalman updates of all modes. Returns the information gained [nats].
double FusionObserver::take(Estimate& modes, const Reading& reading) noexcept {
  double information = 0.0;
  for (std::size_t j = 0; j < models; ++j)
    information += modes[j].probability * apply(modes[j].mean, modes[j].covariance, reading.gains[j],
                                                reading.before[j], reading.shift[j], reading.keep[j]);
  renormalise(modes, reading.likelihood);
  return information;
}

FusionObserver::Reading FusionObserver::velocity_reading(const Estimate& modes, std::size_t i,
                                                         const FusionSample& sample) const noexcept {
  const VelocitySensorModel& sensor = model_.velocities[i];
  const double noise = velocity_memory_[i].variance * sensor.correlation * sensor.correlation;
  Reading reading;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t j = 0; j < models; ++j) {
    const Mode& mode = modes[j];
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
    const double innovation = sample.velocities[i] - sensor.offset - mode.mean(own + 1) - gain * response;
    reading.gains[j] = row.times(mode.covariance);
    reading.before[j] = row.dot(reading.gains[j]);
    const double variance = reading.before[j] + noise;
    // The scalar row . state: its variance shrinks to noise / (noise + its own) of what it was.
    reading.shift[j] = innovation * reading.before[j] / variance;
    reading.keep[j] = noise / variance;
    const double z = std::abs(innovation) / std::sqrt(variance);
    reading.likelihood[j] = normal_density(std::min(z, 8.0)) / std::sqrt(variance);
    least = std::min(least, z);
  }
  reading.probability = 2.0 * beyond(least);
  return reading;
}

void FusionObserver::use_velocity(std::size_t i, const FusionSample& sample) noexcept {
  if (silent(sample, positions_ + i)) return;
  VelocityMemory& memory = velocity_memory_[i];
  if (!std::isfinite(sample.velocities[i])) {
    memory.faulty = true;  // it must prove itself again
    memory.good = good_limit - 2;
    return;
  }
  const Reading reading = velocity_reading(modes_, i, sample);
  const Reading unheld = velocity_reading(unheld_, i, sample);
  // Where only an estimate that a standing reading holds back is surprised, the velocity sensor is not to blame.
  const bool odd = std::max(reading.probability, unheld.probability) < odd_velocity;
  memory.odd = odd ? memory.odd + 1 : 0;
  memory.good = odd || memory.dead ? 0 : memory.good + 1;
  if (memory.dead || memory.odd >= odd_limit) memory.faulty = true;
  if (memory.faulty && memory.good >= good_limit) memory.faulty = false;
  if (memory.faulty) return;
  if (unheld.probability >= odd_velocity) take(unheld_, unheld);
  if (reading.probability >= odd_velocity) information_[positions_ + i] += take(modes_, reading);
}

FusionObserver::Reading FusionObserver::position_reading(const Estimate& modes, std::size_t i,
                                                         const FusionSample& sample) const noexcept {
  const PositionSensorModel& sensor = model_.positions[i];
  const double read = sample.positions[i];
  Reading reading;
  for (std::size_t j = 0; j < models; ++j) {
    const Mode& mode = modes[j];
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
    reading.gains[j] = row.times(mode.covariance);
    reading.before[j] = std::max(row.dot(reading.gains[j]), 1e-18);
    const double noise = std::max(sensor.noise, 1e-7);
    const double deviation = std::sqrt(reading.before[j] + noise * noise);
    Cut found;
    double most = 1.0;
    if (sensor.step > 0.0) {
      found = cut((read - 0.5 * sensor.step - expected) / deviation,
                  (read + 0.5 * sensor.step - expected) / deviation);
      most = std::max(most_probable(0.0, sensor.step / deviation), 1e-12);
    } else {
      const double z = (read - expected) / deviation;
      found = {std::exp(-0.5 * z * z), z, 0.0};  // state and noise together are known exactly
    }
    const double ratio =
        reading.before[j] / (deviation * deviation);  // the state's share of the scalar's variance
    reading.shift[j] = found.mean * deviation * ratio;
    reading.keep[j] = 1.0 - (1.0 - found.variance) * ratio;
    reading.likelihood[j] = sensor.step > 0.0 ? found.probability : found.probability / deviation;
    reading.probability += mode.probability * found.probability / most;
  }
  return reading;
}

void FusionObserver::use_position(std::size_t i, const FusionSample& sample) noexcept {
  if (silent(sample, i)) return;
  const PositionSensorModel& sensor = model_.positions[i];
  PositionMemory& memory = position_memory_[i];
  const double read = sample.positions[i];
  if (!std::isfinite(read)) {
    memory.faulty = true;
    memory.good = good_limit - 2;
    return;
  }
  const bool moved = read != memory.last && std::isfinite(memory.last);
  if (moved) see_change(i, read, sample.period);
  if (moved) memory.travel = memory.travel_variance = 0.0;
  const bool again = moved && counts_again(i, read);
  if (!moved && memory.faulty && sensor.step > 0.0 && stood_still(i, sample)) memory.left = true;
  const double change = std::abs(read - memory.last);
  memory.last = read;
  Reading reading = position_reading(modes_, i, sample);
  const Reading unheld = position_reading(unheld_, i, sample);
  if (moved && !memory.faulty && reading.probability < surprise && change < 2.5 * sensor.step &&
      only_position(i)) {
    // It counts where the estimate did not expect it: held by the readings before, or lost.
    if (unheld.probability < doubtful) {
      restart_at(i, read);
      return;
    }
    modes_ = unheld_;
    reading = unheld;
  }
  const bool odd = reading.probability < surprise;
  const bool stands = !moved && sensor.step > 0.0;
  memory.unheld = stands ? unheld.probability : 1.0;
  // A reading that stands still while the rest moves on is refuted little by little; an edge clears it.
  if (moved && !odd) memory.conflict = 0.0;
  if (moved && reading.probability >= doubtful) memory.left = false;
  memory.conflict = std::clamp(
      memory.conflict - std::log(std::max(reading.probability, 1e-30)) - (sensor.step > 0.0 ? 0.3 : 2.0), 0.0,
      2.0 * stuck_conflict);  // no more, so that a sensor can live it down
  memory.odd = odd ? memory.odd + 1 : 0;
  memory.good = odd || reading.probability < doubtful ? 0 : memory.good + 1;
  if (alone(i) && !(memory.faulty && !moved) && (memory.odd >= 2 || memory.conflict > stuck_conflict)) {
    restart_at(i, read);
    return;
  }
  if (memory.odd >= odd_limit)
    for (std::size_t k = 0; k < positions_; ++k)
      if (k != i && !position_memory_[k].faulty && outlived(k, i, read)) {
        position_memory_[k].faulty = true;  // it stood still while this one moved on
        position_memory_[k].good = 0;
        restart_at(i, read);
        return;
      }
  const bool refuted = stands && unheld.probability < surprise && refuted_standing(i, read);
  if (refuted && !memory.faulty &&
      (memory.odd >= odd_limit || memory.conflict > stuck_conflict || left_behind(i, read))) {
    leave(i, read);
    return;
  }
  // Others doubt a reading that stands still: the estimate waits who is right, with gains that may be wrong.
  if (stands && !memory.faulty && odd && witnessed()) {
    if (memory.odd >= odd_limit && !refuted && !refuted_jump(i)) restart(i, read);
    return;
  }
  // Nobody contradicts the sensor: it is the estimate that was lost.
  if (!memory.faulty && memory.odd >= odd_limit && !refuted_jump(i)) {
    restart_at(i, read);
    return;
  }
  if (memory.faulty && moved && (again || counts_on(i, read))) {
    if (reading.probability < doubtful) {
      restart_at(i, read);
      return;
    }
    memory.faulty = memory.left = false;
    memory.conflict = 0.0;
  }
  if (!memory.faulty &&
      (memory.odd >= odd_limit || (!moved && memory.conflict > stuck_conflict && !only_position(i)))) {
    memory.faulty = true;
    memory.from = read;
  }
  if (memory.faulty && !memory.left && memory.good >= good_limit && memory.conflict <= 0.0)
    memory.faulty = false;
  if (memory.faulty || odd) return;
  memory.leapt = 0.0;
  information_[i] += take(modes_, reading);
  if (moved) {
    unheld_ = modes_;
    settled_at_ = mean(modes_)(0);
  } else if (sensor.step <= 0.0 && unheld.probability >= surprise) {
    take(unheld_, unheld);
  }
}

}  // namespace invar::metrology
