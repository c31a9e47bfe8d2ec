// Who is to be believed: noise learned on line, sensors that died, stick or jump, and what to do about it.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/metrology/fusion_observer.hpp"

namespace invar::metrology {

namespace {
constexpr double noise_memory = 400.0;  // samples
constexpr double lost_gain =
    0.1;  // how well gains are known, relative, when the estimate that used them was lost
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

/// By how much, relative, the travel that the velocity sensors tell may be wrong.
double FusionObserver::doubt() const noexcept {
  double most = 0.0;
  for (const VelocitySensorModel& sensor : model_.velocities) most = std::max(most, 10.0 * sensor.gain_sigma);
  return std::min(most, 0.5);
}

/// True where the velocity sensors tell, beyond their noise and what their gain may be, that a position which reads the same
/// went on by more than its cell.
bool FusionObserver::travelled_on(std::size_t position) const noexcept {
  const PositionMemory& memory = position_memory_[position];
  const double cell =
      std::max(0.75 * model_.positions[position].step, 10.0 * model_.positions[position].noise);
  return std::abs(memory.travel) > (1.0 + 2.0 * doubt()) * cell + 5.0 * std::sqrt(memory.travel_variance) &&
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

/// True where a witness says that a position which reads the same cannot stand still: a velocity sensor, or another position
/// sensor. A filter that merely expected motion is no witness.
bool FusionObserver::refuted_standing(std::size_t position) const noexcept {
  return travelled_on(position) || !only_position(position);
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
                        doubt() * std::abs(memory.travel);
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
  modes_ = past_[(steps_ - steps) % history].modes;
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

/// The estimate where a position sensor meets no conflict: from here it can go on without it.
void FusionObserver::agree(std::size_t position) noexcept {
  PositionMemory& memory = position_memory_[position];
  memory.agreed = 0.0;
  memory.agreed_variance = 0.0;
  for (const Mode& mode : modes_) {
    memory.agreed += mode.probability * mode.mean(0);
    memory.agreed_variance += mode.probability * mode.covariance(0, 0);
  }
  memory.agreed_travel = memory.travel;
  memory.agreed_travel_variance = memory.travel_variance;
}

/// A sensor that stood still while the axis moved held the estimate back, and taught it wrong gains: on from where they last
/// agreed, by what the velocity sensors told since, with the gains as they were when positions were last counted.
void FusionObserver::go_on_without(std::size_t position, const FusionSample& sample) noexcept {
  const PositionMemory& memory = position_memory_[position];
  double speed = 0.0, speed_variance = 0.0;
  for (std::size_t i = 0; i < velocities_; ++i) {
    if (silent(sample, positions_ + i) || velocity_memory_[i].faulty || !std::isfinite(sample.velocities[i]))
      continue;
    const double gain = std::max(std::abs(model_.velocities[i].sensitivity(0.0)), 1e-6);
    speed = (sample.velocities[i] - model_.velocities[i].offset) / gain;
    speed_variance = velocity_memory_[i].variance / (gain * gain);
    break;
  }
  const double travel = memory.travel - memory.agreed_travel;
  const double variance =
      memory.agreed_variance + std::max(0.0, memory.travel_variance - memory.agreed_travel_variance);
  constexpr double hardest = 2.0;  // m/s2, that the axis may accelerate by meanwhile
  for (std::size_t j = 0; j < models; ++j) {
    Mode& mode = modes_[j];
    if (counted_[j].mean.size() == states_) {
      mode.mean.tail(states_ - 3) = counted_[j].mean.tail(states_ - 3);
      mode.covariance = counted_[j].covariance;
    }
    mode.mean.head<3>() << memory.agreed + travel, speed, 0.0;
    mode.covariance.topRows<3>().setZero();
    mode.covariance.leftCols<3>().setZero();
    mode.covariance.diagonal().head<3>() << variance, speed_variance, hardest * hardest;
    mode.probability = 1.0 / models;
  }
}

/// The sensor is to be trusted, not the estimate: begin anew in the cell that is read, at unknown speed. What is known of the
/// sensors stays, but gains with which the estimate was lost are not known.
void FusionObserver::restart_at(std::size_t position, double reading) noexcept {
  const PositionSensorModel& sensor = model_.positions[position];
  PositionMemory& memory = position_memory_[position];
  memory.faulty = memory.left = false;
  memory.odd = 0;
  memory.conflict = memory.leapt = 0.0;
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
