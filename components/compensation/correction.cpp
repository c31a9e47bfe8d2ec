// The loop's part of Compensation: temperatures in, corrections out.
#include <algorithm>
#include <cmath>

#include "components/compensation/compensation.hpp"

namespace invar::compensation {

namespace {

// While a temperature is stale it may have gone on at its last rate, at least at this one.
constexpr double least_drift = 1e-3;  // K/s
// A body behind its sensor may have been so far from equilibrium where the memory of temperatures begins.
constexpr double unknown_start = 1.0;  // K

double beyond(const Range& range, double value) noexcept { return std::abs(value - range.clamp(value)); }

const char* text_of(TemperatureCondition condition) noexcept {
  switch (condition) {
    case TEMPERATURE_OUTSIDE:
      return "temperature or heating rate lie outside what was calibrated: the value at the end is held";
    case TEMPERATURE_HELD:
      return "the temperature is stale: the last one is held";
    case TEMPERATURE_REFUSED:
      return "the temperature is lost or too far outside what was calibrated: its correction is taken out";
    default:
      return "the temperature is sound: its correction is in use";
  }
}

event::Severity severity_of(TemperatureCondition condition) noexcept {
  if (condition == TEMPERATURE_REFUSED) return event::SEVERITY_FAULT;
  return condition == TEMPERATURE_SOUND ? event::SEVERITY_NOTE : event::SEVERITY_WARNING;
}

}  // namespace

double Compensation::kelvin_outside(const LiveModel& model) const noexcept {
  const double own = model.lag > 0.0 ? model.lagged : temperatures_.trace().temperature();
  double most = beyond(model.temperature, own);
  for (std::size_t z = 0; z < model.zone_ranges.size(); ++z)
    most = std::max(most, beyond(model.zone_ranges[z], temperatures_.zone(model.zones[z])));
  return most;
}

TemperatureCondition Compensation::judge(Instant at) noexcept {
  bool used = expands();
  bool inside = true;
  double most = 0.0;
  unsigned zones = 0;
  if (has_states()) {
    used = true;
    most = kelvin_outside(*active_.geometric);
    for (const auto& state : active_.geometric->states) {
      inside = inside && state.range.contains(value_of(state));
      if (state.source != LiveModel::Source::zone) continue;
      zones |= 1U << state.zone;
      most = std::max(most, beyond(state.range, value_of(state)));
    }
  }
  for (const LiveModel* model : active_.thermal) {
    if (model == nullptr || !model->by_temperature) continue;
    used = true;
    inside = inside && model->thermal->inside();
    most = std::max(most, kelvin_outside(*model));
    for (std::size_t z = 0; z < model->zone_ranges.size(); ++z) zones |= 1U << model->zones[z];
  }
  if (!used) return TEMPERATURE_UNUSED;
  const Duration age = temperatures_.age(at, zones);
  const Duration timeout = Duration::seconds(parameters_.temperature_timeout);
  const Duration hold = Duration::seconds(parameters_.temperature_hold);
  const bool ever = age.ns != INT64_MAX;
  if (!ever && at - started_ <= timeout + hold) return TEMPERATURE_UNUSED;  // the cell is coming up
  if (!ever || age > timeout + hold) return TEMPERATURE_REFUSED;
  if (most > parameters_.most_outside) return TEMPERATURE_REFUSED;
  if (age > timeout) return condition_ == TEMPERATURE_REFUSED ? TEMPERATURE_REFUSED : TEMPERATURE_HELD;
  // Noise at the end of a range must not ring the bell each second.
  if (!inside) outside_at_ = at;
  const bool lately = outside_at_.ns != INT64_MIN && at - outside_at_ < Duration::seconds(10.0);
  return lately ? TEMPERATURE_OUTSIDE : TEMPERATURE_SOUND;
}

void Compensation::set_temperatures() noexcept {
  if (temperatures_.trace().empty()) return;
  expanded_to_ = temperatures_.trace().temperature();
  for (LiveModel* model : active_.thermal) {
    if (model == nullptr) continue;
    std::array<double, metrology::most_zones> zones{};
    for (std::size_t z = 0; z < model->zone_ranges.size(); ++z)
      zones[z] = temperatures_.zone(model->zones[z]);
    model->thermal->set(model->lag > 0.0 ? model->lagged : temperatures_.trace().temperature(),
                        temperatures_.trace().rate(), zones);
  }
}

double Compensation::value_of(const LiveModel::State& state) const noexcept {
  switch (state.source) {
    case LiveModel::Source::heating_rate:
      return temperatures_.trace().rate();
    case LiveModel::Source::zone:
      return temperatures_.zone(state.zone);
    default:
      return temperatures_.trace().temperature();
  }
}

/// What the error motions depend on; without a temperature they are those of the middle of the calibration.
void Compensation::set_states() noexcept {
  if (!has_states()) return;
  LiveModel& model = *active_.geometric;
  if (!has_temperature()) return model.components->forget();
  for (std::size_t s = 0; s < model.states.size(); ++s) model.components->set(s, value_of(model.states[s]));
}

void Compensation::follow_temperature(const Tick& tick) noexcept {
  const TemperatureCondition before = condition_;
  const bool first = temperatures_.trace().empty();
  if (temperatures_.update(tick.now)) {
    const double temperature = temperatures_.trace().temperature();
    for (LiveModel* model : active_.thermal)
      if (model != nullptr && model->lag > 0.0)
        model->lagged = first ? temperature
                              : metrology::lag_step(model->lagged, temperature_before_, temperature,
                                                    (tick.now - lags_at_).in_seconds(), model->lag);
    temperature_before_ = temperature;
    lags_at_ = tick.now;
    ease([&] {
      set_temperatures();
      condition_ = judge(tick.now);
      set_states();
    });
  } else if (const auto next = judge(tick.now); next != condition_) {
    ease([&] {
      condition_ = next;
      set_states();
    });
  }
  if (condition_ == before) return;
  if (condition_ != TEMPERATURE_UNUSED) notify(severity_of(condition_), text_of(condition_));
  publish_status();
}

Compensation::Layers Compensation::corrections(const Eigen::Vector3d& at) const noexcept {
  Layers layers;
  if (active_.geometric != nullptr)
    layers.geometric = -active_.geometric->error(at) - active_.geometric->reversal(at, moving_);
  if (expands() && has_temperature())
    layers.geometric -= active_.geometric->expanding.expansion_at(at, expanded_to_);
  for (std::size_t i = 0; i < axes_.size(); ++i)
    if (is_used(active_.thermal[i])) {
      const auto k = static_cast<Eigen::Index>(i);
      layers.thermal[k] = -active_.thermal[i]->thermal->value(at[k]);
    }
  return layers;
}

/// The second step of the fixed point: the error where the machine is really sent
/// (docs/explanation/geometric.md#correction-in-the-controller).
Compensation::Layers Compensation::wanted(const Eigen::Vector3d& setpoint) const noexcept {
  return corrections(setpoint + corrections(setpoint).sum());
}

/// How far the temperature may have gone since it was last heard [K].
double Compensation::kelvin_in_doubt(Instant at, unsigned zones) const noexcept {
  if (condition_ != TEMPERATURE_HELD) return 0.0;
  return std::max(std::abs(temperatures_.trace().rate()), least_drift) *
         temperatures_.age(at, zones).in_seconds();
}

Eigen::Vector3d Compensation::geometric_sigma(Instant at) const noexcept {
  if (active_.geometric == nullptr || blind_) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d sigma = active_.geometric->sigma(setpoint_);
  if (!has_temperature()) return sigma;
  if (has_states() && condition_ == TEMPERATURE_HELD) {
    // The temperatures may have gone on: what that changes is in doubt.
    LiveModel& model = *active_.geometric;
    const Eigen::Vector3d held = model.error(setpoint_);
    for (std::size_t s = 0; s < model.states.size(); ++s)
      if (model.states[s].source != LiveModel::Source::heating_rate)
        model.components->set(s, value_of(model.states[s]) + kelvin_in_doubt(at, 0));
    const Eigen::Vector3d change = model.error(setpoint_) - held;
    for (std::size_t s = 0; s < model.states.size(); ++s) model.components->set(s, value_of(model.states[s]));
    return (sigma.cwiseAbs2() + change.cwiseAbs2()).cwiseSqrt();
  }
  if (!expands()) return sigma;
  const auto& model = active_.geometric->expanding;
  const Eigen::Vector3d doubt = model.expansion_at(setpoint_, expanded_to_ + kelvin_in_doubt(at, 0)) -
                                model.expansion_at(setpoint_, expanded_to_);
  return (sigma.cwiseAbs2() + model.expansion_sigma_at(setpoint_, expanded_to_).cwiseAbs2() +
          doubt.cwiseAbs2())
      .cwiseSqrt();
}

double Compensation::thermal_sigma(const LiveModel& model, double x, Instant at) const noexcept {
  unsigned zones = 0;
  for (std::size_t z = 0; z < model.zone_ranges.size(); ++z) zones |= 1U << model.zones[z];
  double doubt = kelvin_in_doubt(at, zones);
  if (model.lag > 0.0) doubt += unknown_start * std::exp(-temperatures_.trace().known() / model.lag);
  return std::hypot(model.thermal->sigma(x), model.slope_temperature * doubt);
}

/// An axis that turns loses its motion at once; the correction follows at `rate_limit`.
void Compensation::follow_motion(const Eigen::Vector3d& velocity) noexcept {
  Eigen::Vector3d moving = moving_;
  for (int k = 0; k < 3; ++k)
    if (velocity[k] != 0.0) moving[k] = velocity[k] > 0.0 ? 1.0 : -1.0;
  if (moving == moving_) return;
  ease([&] { moving_ = moving; });
}

void Compensation::correct(const Tick& tick) noexcept {
  bool stale = false;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const auto* state = axes_[i]->state.latest();
    stale =
        stale || state == nullptr || axes_[i]->state.age(tick.now) > Duration::seconds(20.0 * tick.period);
    if (state == nullptr) continue;
    setpoint_[static_cast<Eigen::Index>(i)] = state->setpoint_position();
    velocity[static_cast<Eigen::Index>(i)] = state->setpoint_velocity();
    // Whoever corrected before, this or another process: go on from where the axis stands.
    if (blind_) applied_[static_cast<Eigen::Index>(i)] = state->correction();
  }
  const Eigen::Vector3d before = applied_;
  Layers layers;
  if (stale) {
    easing_ = applied_;  // no position to correct for: the last correction holds
    blind_ = true;
    clamped_ = false;
  } else {
    follow_motion(velocity);
    layers = wanted(setpoint_);
    if (blind_) easing_ = applied_ - layers.sum();
    blind_ = false;
    const double most = parameters_.rate_limit * tick.period;
    easing_ -= easing_.cwiseMax(-most).cwiseMin(most).eval();
    const Eigen::Vector3d all = layers.sum() + easing_;
    applied_ = all.cwiseMax(-parameters_.bound).cwiseMin(parameters_.bound);
    clamped_ = applied_ != all;
    easing_ += applied_ - all;
  }
  publish(tick, layers, before);
}

void Compensation::publish(const Tick& tick, const Layers& layers, const Eigen::Vector3d& before) noexcept {
  const Eigen::Vector3d sigma = geometric_sigma(tick.now);
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const LiveModel* thermal = active_.thermal[i];
    AxisCorrection sample;
    stamp(sample);
    sample.axis(static_cast<std::uint32_t>(i));
    sample.correction(applied_[k]);
    sample.rate((applied_[k] - before[k]) / tick.period);
    sample.layer_count(3);
    sample.contribution() = {layers.geometric[k], layers.thermal[k], easing_[k]};
    sample.layer_sigma()[0] = sigma[k];
    if (is_used(thermal) && !blind_)
      sample.layer_sigma()[1] = thermal_sigma(*thermal, setpoint_[k], tick.now);
    sample.sigma(std::hypot(sample.layer_sigma()[0], sample.layer_sigma()[1]));
    if (active_.geometric != nullptr) sample.layer_checksum()[0] = active_.geometric->checksum;
    if (thermal != nullptr) sample.layer_checksum()[1] = thermal->checksum;
    const bool by_temperature = thermal != nullptr || expands() || has_states();
    if (by_temperature) {
      sample.temperature(temperatures_.trace().temperature());
      sample.heating_rate(temperatures_.trace().rate());
      sample.outside(condition_ == TEMPERATURE_OUTSIDE);
      sample.refused(condition_ == TEMPERATURE_REFUSED);
    }
    sample.stale(blind_ || (by_temperature && condition_ == TEMPERATURE_HELD));
    sample.limited(clamped_ || easing_[k] != 0.0);
    axes_[i]->correction.write(sample);
  }
}

}  // namespace invar::compensation
