#include "components/dispenser/valve.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace invar::dispenser {

using namespace dispensing;

namespace {

/// An axis in machine coordinates, moved on by the age of its sample.
struct AxisMotion {
  double position, velocity, acceleration;
  AxisMotion(const stage::AxisState& state, Duration age)
      : velocity{state.setpoint_velocity()}, acceleration{state.setpoint_acceleration()} {
    const double since = age.in_seconds();
    position = state.position() - state.correction() + since * (velocity + 0.5 * since * acceleration);
    velocity += since * acceleration;
  }
};

constexpr double closest = 0.999;  // of the driver's period between two pulses: times are whole nanoseconds

bool is_ready(const stage::AxisState& state) { return state.enabled() && state.homed(); }

}  // namespace

void Valve::configure() {
  loaded_.points().reserve(most_points);
  done_.reserve(most_points);
}

void Valve::activate() {
  loaded_.points().clear();
  done_.clear();
  sample_ = {};
  last_open_ns_ = std::numeric_limits<std::int64_t>::min() / 2;
  changed_ = true;
}

void Valve::deactivate() noexcept { sample_.armed(false); }

void Valve::publish() noexcept {
  if (!changed_) return;
  changed_ = false;
  stamp(sample_, {clock_ns_});
  sample_.component_id(id);
  state_.write(sample_);
}

void Valve::refuse(std::uint64_t droplet, const Refusal& why) noexcept {
  DropletRefused refused;
  stamp(refused, {clock_ns_});
  refused.component_id(id);
  refused.droplet(droplet);
  refused.pattern_id(loaded_.id());
  refused.reason(why.reason);
  refused.text(why.text);
  refused_.write(refused);
  sample_.refused(sample_.refused() + 1);
  changed_ = true;
}

/// Points that the nozzle never passed are refused now, so that nothing is lost without a word.
void Valve::disarm() noexcept {
  if (!sample_.armed()) return;
  for (std::size_t i = 0; i < done_.size(); ++i)
    if (done_[i] == 0)
      refuse(loaded_.points()[i].droplet(), {REFUSED_NOT_PASSED, "the nozzle did not pass its point"});
  std::fill(done_.begin(), done_.end(), 1);
  sample_.armed(false);
  changed_ = true;
}

void Valve::obey(const TriggerCommand& command, const Tick& tick) noexcept {
  switch (command.kind()) {
    case TRIGGER_ARM:
      disarm();
      sample_.armed(command.pattern_id() == loaded_.id() && !done_.empty());
      std::fill(done_.begin(), done_.end(), 0);
      sample_.jetted(0);
      sample_.refused(0);
      break;
    case TRIGGER_DISARM:
      disarm();
      break;
    case TRIGGER_JET_NOW:
      jet_now(command.pulse_ns(), tick);
      break;
  }
  sample_.command_id(command.id());
  changed_ = true;
}

/// Nothing where the stage says nothing fresh.
std::optional<Motion> Valve::motion(const Tick& tick) noexcept {
  const auto* x = state_x_.latest();
  const auto* y = state_y_.latest();
  const Duration patience = Duration::seconds(parameters_.stage_timeout);
  if (x == nullptr || y == nullptr || state_x_.age(tick.now) > patience || state_y_.age(tick.now) > patience)
    return {};
  const AxisMotion along_x{*x, state_x_.age(tick.now)};
  const AxisMotion along_y{*y, state_y_.age(tick.now)};
  return Motion{{along_x.position, along_y.position},
                {along_x.velocity, along_y.velocity},
                {along_x.acceleration, along_y.acceleration}};
}

/// Why nothing may be jetted; the order is that of what a user would mend first.
std::optional<Valve::Refusal> Valve::refusal(std::int64_t pulse_ns, std::int64_t open_ns,
                                             const Tick& tick) noexcept {
  const auto* pressure = pressure_.latest();
  if (pressure == nullptr || pressure->stale() ||
      pressure_.age(tick.now) > Duration::seconds(parameters_.pressure_timeout))
    return Refusal{REFUSED_PRESSURE_STALE, "the pneumatic controller does not answer"};
  if (!pressure->enabled() || !pressure->in_band())
    return Refusal{REFUSED_PRESSURE, "the pressure is out of band"};
  if (!is_ready(*state_x_.latest()) || !is_ready(*state_y_.latest()))
    return Refusal{REFUSED_STAGE_NOT_READY, "an axis is not enabled or not homed"};
  if (const auto* temperature = temperature_.latest();
      temperature != nullptr &&
      (temperature->stale() || !parameters_.temperature.contains(temperature->temperature())))
    return Refusal{REFUSED_TEMPERATURE, "the temperature is unknown or outside its window"};
  if (!parameters_.pulses.contains(static_cast<double>(pulse_ns) * 1e-9))
    return Refusal{REFUSED_PULSE, "the valve does not work at this on-time"};
  if (static_cast<double>(open_ns - last_open_ns_) < closest * 1e9 / parameters_.most_rate)
    return Refusal{REFUSED_TOO_FAST, "due too soon after the last droplet"};
  return {};
}

void Valve::jet(const TriggerPoint& point, const Motion& at, std::int64_t open_ns, Range velocity,
                const Tick& tick) noexcept {
  const std::int64_t pulse_ns =
      point.pulse_ns() != 0 ? point.pulse_ns() : Duration::seconds(parameters_.pulse).ns;
  if (const auto why = refusal(pulse_ns, open_ns, tick)) {
    refuse(point.droplet(), *why);
    return;
  }
  if (!velocity.contains(at.velocity.norm())) {
    refuse(point.droplet(), {REFUSED_VELOCITY, "the stage's velocity is outside its window"});
    return;
  }
  ValvePulse pulse;
  stamp(pulse, {clock_ns_});
  pulse.component_id(id);
  pulse.droplet(point.droplet());
  pulse.open_ns(open_ns);
  pulse.pulse_ns(pulse_ns);
  pulse.spike_ns(std::min(Duration::seconds(parameters_.spike.time).ns, pulse_ns));
  pulse.spike_current(parameters_.spike.current);
  pulse.hold_current(parameters_.hold_current);
  pulse_.write(pulse);
  last_open_ns_ = open_ns;

  DropletJetted jetted;
  stamp(jetted, {open_ns});
  jetted.component_id(id);
  jetted.droplet(point.droplet());
  jetted.pattern_id(loaded_.id());
  jetted.position({at.position.x(), at.position.y(), point.position()[2]});
  jetted.velocity({at.velocity.x(), at.velocity.y(), 0.0});
  jetted.target(point.target());
  jetted.pressure(pressure_.latest()->pressure());
  jetted.pulse_ns(pulse_ns);
  jetted_.write(jetted);
  sample_.jetted(sample_.jetted() + 1);
  changed_ = true;
}

/// A droplet by command, to clear the nozzle or to look at it: at any velocity, but only over the armed pattern.
void Valve::jet_now(std::int64_t pulse_ns, const Tick& tick) noexcept {
  const auto moving = motion(tick);
  TriggerPoint point;
  point.pulse_ns(pulse_ns);
  if (!sample_.armed()) {
    refuse(0, {REFUSED_NOT_ARMED, "no pattern is armed"});
  } else if (!moving) {
    refuse(0, {REFUSED_STAGE_NOT_READY, "the stage's state is stale"});
  } else if (!box_[0].contains(moving->position.x()) || !box_[1].contains(moving->position.y())) {
    refuse(0, {REFUSED_OUTSIDE_PATTERN, "the nozzle is not over the pattern"});
  } else {
    point.target({moving->position.x(), moving->position.y(), 0.0});
    const std::int64_t open_ns = clock_ns_ + Duration::seconds(parameters_.ahead).ns;
    jet(point, *moving, open_ns, Range{}, tick);
  }
}

void Valve::step(const Tick& tick) noexcept {
  // Times are given on the clock of the stage's stamps, whichever that is: the droplet belongs to a place.
  const auto* state = state_x_.latest();
  clock_ns_ = state != nullptr ? state->at().time_ns() + state_x_.age(tick.now).ns : tick.now.ns;
  while (pattern_.take(loaded_)) {
    sample_.armed(false);
    const std::size_t count = std::min(loaded_.points().size(), most_points);
    loaded_.points().resize(count);
    done_.assign(count, 0);
    box_ = {Range{1e9, -1e9}, Range{1e9, -1e9}};
    for (const TriggerPoint& point : loaded_.points())
      for (std::size_t k = 0; k < 2; ++k) {
        box_[k].lower = std::min(box_[k].lower, point.target()[k] - parameters_.margin);
        box_[k].upper = std::max(box_[k].upper, point.target()[k] + parameters_.margin);
      }
    sample_.pattern_id(loaded_.id());
    sample_.points(static_cast<std::uint32_t>(count));
    sample_.jetted(0);
    sample_.refused(0);
    changed_ = true;
  }
  TriggerCommand command;
  while (command_.take(command)) obey(command, tick);

  if (const auto moving = sample_.armed() ? motion(tick) : std::nullopt) {
    // What is passed before the end of the next period is due now; what was passed up to a period ago and not seen coming
    // (a jerk, a late cycle) opens at once.
    const double latest = parameters_.ahead + tick.period;
    const double earliest = parameters_.ahead - tick.period;
    for (std::size_t i = 0; i < done_.size(); ++i) {
      if (done_[i] != 0) continue;
      const TriggerPoint& point = loaded_.points()[i];
      const auto passed = crossing(*moving, {point.position()[0], point.position()[1]},
                                   static_cast<double>(point.lead_ns()) * 1e-9);
      if (!passed || passed->beside > parameters_.beside || passed->time >= latest || passed->time < earliest)
        continue;
      done_[i] = 1;
      const double time = std::max(passed->time, 0.0);
      jet(point, {moving->position_at(time), moving->velocity_at(time), moving->acceleration},
          clock_ns_ + Duration::seconds(time).ns, parameters_.velocity, tick);
    }
  }
  publish();
}

}  // namespace invar::dispenser
