#include "components/world/simulated_sensor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/physics/terms/sensor/bias.hpp"
#include "core/physics/terms/sensor/gain_droop.hpp"
#include "core/physics/terms/sensor/hysteresis.hpp"
#include "core/physics/terms/sensor/latency.hpp"
#include "core/physics/terms/sensor/periodic_error.hpp"

namespace invar::world {

namespace {

std::vector<physics::SensorTerm> terms_of(const SimulatedSensor::Parameters& p) {
  using namespace physics::sensor;
  std::vector<physics::SensorTerm> terms;
  if (p.latency > 0.0) terms.push_back({&Latency::kind, {p.latency}});
  if (p.hysteresis > 0.0) terms.push_back({&Hysteresis::kind, {p.hysteresis}});
  if (p.gain_droop > 0.0) terms.push_back({&GainDroop::kind, {p.gain_droop}});
  if (p.pitch_error > 0.0) terms.push_back({&PeriodicError::kind, {p.pitch_error, p.pitch, 0.0}});
  if (p.bias != 0.0) terms.push_back({&Bias::kind, {p.bias}});
  return terms;
}

}  // namespace

SimulatedSensor::SimulatedSensor(const Parameters& parameters)
    : parameters_{parameters},
      is_position_{parameters.quantity == "position"},
      plant_{
          is_position_ ? physics::SensorPlant::Quantity::position : physics::SensorPlant::Quantity::velocity,
          terms_of(parameters), parameters.gain},
      random_{static_cast<std::uint64_t>(parameters.seed)} {}

void SimulatedSensor::activate() {
  random_.seed(static_cast<std::uint64_t>(parameters_.seed));
  uniform_.reset();
  first_ = true;
  next_ = 0.0;
  count_ = 0;
}

void SimulatedSensor::step(const Tick& tick) noexcept {
  const auto* truth = truth_.latest();
  if (truth == nullptr) return;
  if (first_) {
    plant_.rest_at(truth->position());
    started_ = last_ = tick.now;
    first_ = false;
  }
  const double since = (tick.now - started_).in_seconds();
  double value = plant_.step(truth->position(), truth->velocity(), (tick.now - last_).in_seconds());
  last_ = tick.now;
  if (since + 1e-9 < next_) return;
  next_ += std::max(parameters_.interval, tick.period);
  value += parameters_.bias_drift * since;
  value += parameters_.noise_level * parameters_.largest * uniform_(random_);
  if (const double count = parameters_.resolution; count > 0.0) value = count * std::round(value / count);

  sensing::AxisReading reading;
  stamp(reading);
  reading.sensor(id);
  constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  reading.position(is_position_ ? value : nothing);
  reading.velocity(is_position_ ? nothing : value);
  past_[count_++ % past_size] = reading;
  send(reading, tick, since);
}

/// Writes the reading as the faults leave it.
void SimulatedSensor::send(sensing::AxisReading reading, const Tick& tick, double since) noexcept {
  double value = is_position_ ? reading.position() : reading.velocity();
  bool stuck = false;
  for (const Fault& fault : parameters_.faults) {
    if (since < fault.at || since >= fault.at + fault.duration) continue;
    if (fault.kind == "missing") return;
    if (fault.kind == "dead") value = 0.0;
    if (fault.kind == "jump") value += fault.size;
    if (fault.kind == "stuck") {
      stuck = true;
      value = held_;
    }
    if (fault.kind == "late" || fault.kind == "lagging") {
      const auto back = static_cast<std::size_t>(std::max(0.0, fault.size / tick.period) + 0.5);
      const std::size_t kept = std::min(count_, past_size);
      const auto stamp = reading.at();
      reading = past_[(count_ - 1 - std::min(back, kept - 1)) % past_size];
      if (fault.kind == "lagging") reading.at(stamp);
      value = is_position_ ? reading.position() : reading.velocity();
    }
  }
  if (!stuck) held_ = value;
  (is_position_ ? reading.position() : reading.velocity()) = value;
  reading_.write(reading);
}

}  // namespace invar::world
