// Who is to be believed: noise learned on line, sensors that died, stick or jump, and what to do about it.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/metrology/fusion/fusion_observer.hpp"

namespace invar::metrology {

namespace {
constexpr double noise_memory = 400.0;  // samples
constexpr double lost_gain =
    0.1;  // how well gains are known, relative, when the estimate that used them was lost
constexpr double beyond_doubt =
    0.99;  // probability above which a standing reading takes nothing from the estimate
constexpr double stuck_odds = 1e-4;  // of a sensor that stands still to be stuck, before others tell
}  // namespace

/// White noise of variance s^2 has second differences of variance 6 s^2; motion hardly shows in them.
void FusionObserver::learn_noise(const FusionSample& sample) noexcept {
  for (std::size_t i = 0; i < velocities_; ++i) {
    const VelocitySensorModel& sensor = model_.velocities[i];
    VelocityMemory& memory = velocity_memory_[i];
    const double reading = sample.velocities[i];
    if (silent(sample, positions_ + i) || !std::isfinite(reading)) {
      memory.seen = 0;
      continue;
    }
    memory.largest = std::max(memory.largest, std::abs(reading));
    memory.repeats = memory.seen > 0 && reading == memory.last[0] ? memory.repeats + 1 : 0;
    memory.dead = memory.repeats > 3 * sensor.longest_repeat;
    if (memory.weight <= 0.0) {
      // Until the readings tell: the level as given, of the largest reading that runs usually have.
      const double level = std::isfinite(sample.noise_level) ? std::max(sample.noise_level, 1e-3) : 0.1;
      memory.variance = std::pow(level * sensor.largest, 2) / 3.0;
      memory.weight = 4.0;
    }
    if (memory.seen >= 2 && memory.repeats == 0) {
      const double second = reading - 2.0 * memory.last[0] + memory.last[1];
      const double square = std::min(second * second / 6.0, 16.0 * memory.variance);  // a jump is no noise
      memory.weight = std::min(memory.weight + 1.0, noise_memory);
      memory.variance += (square - memory.variance) / memory.weight;
      memory.variance = std::max(memory.variance, 1e-12 * sensor.largest * sensor.largest);
    }
    memory.last = {reading, memory.last[0]};
    memory.seen = std::min(memory.seen + 1, 2);
  }
}

/// What the first velocity sensor that lives says was travelled since it was last read.
void FusionObserver::add_travel(const FusionSample& sample) noexcept {
  bool witnessed = false;  // one live sensor is witness enough
  for (std::size_t i = 0; i < velocities_; ++i) {
    VelocityMemory& velocity = velocity_memory_[i];
    velocity.unread += sample.period;
    if (silent(sample, positions_ + i)) continue;
    const double time = std::exchange(velocity.unread, 0.0);
    if (witnessed || velocity.faulty || velocity.dead || !std::isfinite(sample.velocities[i])) continue;
    witnessed = true;
    const VelocitySensorModel& sensor = model_.velocities[i];
    const double gain = std::max(std::abs(sensor.sensitivity(0.0)), 1e-6);
    const double noise = sensor.correlation * time / gain;
    const double moved = (sample.velocities[i] - sensor.offset) / gain * time;
    const double variance = velocity.variance * noise * noise;
    for (std::size_t k = 0; k < positions_; ++k) {
      PositionMemory& memory = position_memory_[k];
      memory.travel += moved;
      memory.travel_variance += variance;
    }
  }
}

/// True where the velocity sensors tell, beyond their noise and what their gain may be, that a position which reads the same
/// went on by more than its cell.
bool FusionObserver::travelled_on(std::size_t position) const noexcept {
  const PositionMemory& memory = position_memory_[position];
  const double cell =
      std::max(0.75 * model_.positions[position].step, 10.0 * model_.positions[position].noise);
  return std::abs(memory.travel) > (1.0 + 2.0 * doubt_) * cell + 5.0 * std::sqrt(memory.travel_variance) &&
         memory.travel_variance > 0.0;
}

/// True where others moved on while this position reads the same: velocity sensors, or another position sensor.
bool FusionObserver::stood_still(std::size_t position, const FusionSample& sample) const noexcept {
  if (travelled_on(position)) return true;
  for (std::size_t k = 0; k < positions_; ++k)
    if (k != position && !position_memory_[k].faulty && !silent(sample, k) &&
        std::isfinite(sample.positions[k]) && outlived(position, k, sample.positions[k]))
      return true;
  return false;
}

/// True where a velocity sensor lives that tells whether the axis moves.
bool FusionObserver::witnessed() const noexcept {
  for (std::size_t i = 0; i < velocities_; ++i)
    if (!velocity_memory_[i].faulty) return true;
  return false;
}

/// True where a witness says that a position which reads the same cannot stand still: another position sensor, or a velocity
/// sensor, by more than its gain may be wrong. A filter that merely expected motion is no witness.
bool FusionObserver::refuted_standing(std::size_t position, double reading) const noexcept {
  if (!only_position(position)) return true;
  if (!witnessed()) return false;
  const PositionSensorModel& sensor = model_.positions[position];
  const double at = mean(unheld_)(0);
  const double beyond = std::abs(at - reading - sensor.offset) - 0.5 * sensor.step;
  return beyond > doubt_ * (std::abs(at - settled_at_) + sensor.step);
}

/// True where the others went on by two cells from what is read.
bool FusionObserver::left_behind(std::size_t position, double reading) const noexcept {
  const PositionSensorModel& sensor = model_.positions[position];
  return std::abs(mean(unheld_)(0) - reading - sensor.offset) > 2.5 * sensor.step;
}

/// A reading that differs from the one before, `time` earlier: what no motion explains is a leap. A sensor that comes back
/// where it would have gone meanwhile did not leap.
void FusionObserver::see_change(std::size_t position, double reading, double time) noexcept {
  PositionMemory& memory = position_memory_[position];
  const double cell =
      std::max(2.0 * model_.positions[position].step, 20.0 * model_.positions[position].noise);
  double fastest = 0.3;
  for (const VelocitySensorModel& sensor : model_.velocities)
    fastest = std::max(fastest, 3.0 * sensor.largest);
  const double change = reading - memory.last;
  const double beyond = std::abs(change - memory.travel) - 5.0 * std::sqrt(memory.travel_variance) -
                        doubt_ * std::abs(memory.travel);
  if (std::abs(change) <= cell + fastest * time || beyond <= cell) return;
  memory.leapt += change - memory.travel;
  memory.from = reading;
}

/// True where a witness says that the position cannot have gone from what was last believed to this reading: it leapt and did
/// not leap back, or another position sensor is believed.
bool FusionObserver::refuted_jump(std::size_t position) const noexcept {
  const double cell =
      std::max(2.0 * model_.positions[position].step, 20.0 * model_.positions[position].noise);
  return std::abs(position_memory_[position].leapt) > cell || !only_position(position);
}

bool FusionObserver::only_position(std::size_t position) const noexcept {
  for (std::size_t i = 0; i < positions_; ++i)
    if (i != position && !position_memory_[i].faulty && std::isfinite(position_memory_[i].last)) return false;
  return true;
}

/// True where a sensor that was doubted counts on: it went some cells since, without a leap.
bool FusionObserver::counts_on(std::size_t position, double reading) const noexcept {
  const double cells =
      std::max(3.0 * model_.positions[position].step, 30.0 * model_.positions[position].noise);
  return std::abs(reading - position_memory_[position].from) > 0.9 * cells && !refuted_jump(position);
}

/// True where a sensor that left because it stood still counts within two cells of where the others meanwhile went: it did not
/// stick, they told more than was travelled, and are to be doubted more.
bool FusionObserver::counts_again(std::size_t position, double reading) noexcept {
  const PositionSensorModel& sensor = model_.positions[position];
  const double away = std::abs(reading + sensor.offset - mean(modes_)(0));
  if (!position_memory_[position].left || away > std::max(2.0 * sensor.step, 20.0 * sensor.noise))
    return false;
  doubt_ = std::clamp(2.0 * doubt_, lost_gain, most_doubt);
  return true;
}

/// True where sensor `still` has not changed while `moving` went on by more than both their cells.
bool FusionObserver::outlived(std::size_t still, std::size_t moving, double reading) const noexcept {
  const double cells = model_.positions[still].step + model_.positions[moving].step +
                       10.0 * (model_.positions[still].noise + model_.positions[moving].noise);
  const double before = position_memory_[still].others[moving];
  return std::isfinite(before) && std::abs(reading - before) > cells;
}

/// Sensors that repeat themselves as sound ones do not; what they told since they died is taken back.
void FusionObserver::watch_for_dead(const FusionSample& sample) noexcept {
  int back = 0;
  for (std::size_t i = 0; i < velocities_; ++i) {
    VelocityMemory& memory = velocity_memory_[i];
    if (!memory.dead || memory.faulty) continue;
    memory.faulty = true;
    back = std::max(back, memory.repeats);
  }
  for (std::size_t i = 0; i < positions_; ++i) {
    if (silent(sample, i)) continue;
    PositionMemory& memory = position_memory_[i];
    const double reading = sample.positions[i];
    memory.repeats = reading == memory.last ? memory.repeats + 1 : 0;
    if (memory.repeats == 0 && std::isfinite(reading)) memory.others = sample.positions;
    const bool continuous = model_.positions[i].step <= 0.0;
    if (!continuous || memory.repeats <= 3 + 3 * model_.positions[i].longest_repeat) continue;
    memory.good = 0;
    if (memory.faulty) continue;
    memory.faulty = true;
    memory.from = reading;
    back = std::max(back, memory.repeats);
  }
  undo(static_cast<std::size_t>(back));
}

/// Back by some samples, whose readings turn out to have been those of a dead sensor; the others' since then are
/// used again. Bounded by the history.
void FusionObserver::undo(std::size_t steps) noexcept {
  if (steps == 0 || steps >= history || steps > steps_) return;
  modes_ = unheld_ = past_[(steps_ - steps) % history].modes;
  settled_at_ = mean(modes_)(0);
  for (std::size_t k = steps_ - steps; k < steps_; ++k) {
    Past& past = past_[k % history];
    if (k > steps_ - steps) advance(past.sample.period);
    past.modes = modes_;
    for (std::size_t i = 0; i < velocities_; ++i)
      if (!velocity_memory_[i].faulty) use_velocity(i, past.sample);
    for (std::size_t i = 0; i < positions_; ++i)
      if (!position_memory_[i].faulty) use_position(i, past.sample);
  }
}

/// A sensor that stood still while the axis moved held the estimate back, and taught it wrong gains: on with what the others tell.
void FusionObserver::leave(std::size_t position, double reading) noexcept {
  PositionMemory& memory = position_memory_[position];
  memory.faulty = memory.left = true;
  memory.good = 0;
  memory.unheld = 1.0;
  memory.from = reading;
  modes_ = unheld_;
}

/// Where every reading that stands still is beyond doubt, none holds the estimate back.
void FusionObserver::settle() noexcept {
  for (std::size_t i = 0; i < positions_; ++i)
    if (model_.positions[i].step > 0.0 && !position_memory_[i].faulty &&
        position_memory_[i].unheld < beyond_doubt)
      return;
  unheld_ = modes_;
  settled_at_ = mean(modes_)(0);
}

/// How far the estimate without standing readings is to be believed, where a witness speaks for it: the odds of a stuck sensor
/// against its reading's probability.
double FusionObserver::unheld_weight() const noexcept {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < positions_; ++i)
    if (model_.positions[i].step > 0.0 && !position_memory_[i].faulty &&
        refuted_standing(i, position_memory_[i].last))
      least = std::min(least, position_memory_[i].unheld);
  return stuck_odds / (stuck_odds + least);
}

/// The sensor is to be trusted, not the estimate: begin anew in the cell that is read, at unknown speed. What is known of the
/// sensors stays, but gains with which the estimate was lost are not known.
void FusionObserver::restart_at(std::size_t position, double reading) noexcept {
  PositionMemory& memory = position_memory_[position];
  memory.faulty = memory.left = false;
  memory.unheld = 1.0;
  memory.conflict = memory.leapt = 0.0;
  restart(position, reading);
  unheld_ = modes_;
  settled_at_ = reading + model_.positions[position].offset;
}

void FusionObserver::restart(std::size_t position, double reading) noexcept {
  const PositionSensorModel& sensor = model_.positions[position];
  position_memory_[position].odd = 0;
  double fastest = 0.3;
  for (const VelocitySensorModel& velocity : model_.velocities) fastest = velocity.largest;
  const double cell = std::hypot(sensor.step / std::sqrt(12.0), sensor.noise);
  for (Mode& mode : modes_) {
    mode.mean.head<3>() << reading + sensor.offset, 0.0, 0.0;
    mode.covariance.topRows<3>().setZero();
    mode.covariance.leftCols<3>().setZero();
    mode.covariance.diagonal().head<3>() << cell * cell, fastest * fastest / 4.0, fastest * fastest;
    for (std::size_t i = 0; i < velocities_; ++i) {
      double& gain = mode.covariance(gain_of_velocity(i), gain_of_velocity(i));
      gain = std::max(gain, lost_gain * lost_gain);
    }
    mode.probability = 1.0 / models;
  }
}

bool FusionObserver::alone(std::size_t position) const noexcept {
  for (std::size_t i = 0; i < positions_; ++i)
    if (i != position && !position_memory_[i].faulty) return false;
  for (std::size_t i = 0; i < velocities_; ++i)
    if (!velocity_memory_[i].faulty) return false;
  return true;
}

}  // namespace invar::metrology
