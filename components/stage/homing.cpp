#include "components/stage/homing.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace invar::stage {

namespace {

constexpr double step_back = 1e-3;      // from a hard stop, before it is taken again [m]
constexpr double standing_still = 0.1;  // of the creep velocity: slower is at a stop

}  // namespace

Homing::Settings Homing::settings(const HomingParameters& parameters, double search_velocity, double travel) {
  using Method = Settings::Method;
  Settings result;
  result.method = parameters.method == "limit_switch"  ? Method::limit_switch
                  : parameters.method == "index_pulse" ? Method::index_pulse
                  : parameters.method == "hard_stop"   ? Method::hard_stop
                                                       : Method::home_switch;
  result.toward = parameters.direction == "positive" ? 1.0 : -1.0;
  result.index = parameters.index;
  result.search = search_velocity;
  result.creep = std::min(parameters.creep, search_velocity);
  result.travel = travel;
  result.margin = parameters.margin;
  result.tolerance = parameters.tolerance;
  result.debounce = Duration::seconds(parameters.debounce);
  result.stall = Duration::seconds(parameters.stall_time);
  return result;
}

bool Homing::raw_switch(const Sensed& sensed) const noexcept {
  if (settings_.method == Settings::Method::limit_switch) return limit(sensed, settings_.toward);
  return settings_.method == Settings::Method::home_switch && sensed.home;
}

const char* Homing::switch_name() const noexcept {
  if (settings_.method == Settings::Method::home_switch) return "home switch";
  return settings_.toward < 0.0 ? "lower limit switch" : "upper limit switch";
}

/// The direction in which index pulses are sought.
double Homing::outward() const noexcept {
  return settings_.method == Settings::Method::index_pulse ? settings_.toward : -settings_.toward;
}

/// A switch that bounces has changed where it did so for the last time.
void Homing::watch_switch(const Sensed& sensed) noexcept {
  const bool raw = raw_switch(sensed);
  if (raw == closed_) {
    changes_.reset();
  } else if (!changes_) {
    changes_ = sensed.now;
    changes_at_ = sensed.position;
  }
  if (changes_ && sensed.now - *changes_ >= settings_.debounce) {
    closed_ = raw;
    changed_at_ = changes_at_;
    changes_.reset();
  }
}

Homing::Order Homing::failed(const char* format, ...) noexcept {
  std::va_list values;
  va_start(values, format);
  std::vsnprintf(reason_.data(), reason_.size(), format, values);
  va_end(values);
  return {Order::Kind::failed};
}

Homing::Order Homing::start(const Settings& settings, const Sensed& sensed) noexcept {
  *this = {};
  settings_ = settings;
  closed_ = raw_switch(sensed);
  pulses_ = sensed.pulses;
  const bool by_switch =
      settings.method == Settings::Method::home_switch || settings.method == Settings::Method::limit_switch;
  if (sensed.limit_low && sensed.limit_high)
    return failed("homing ended: both limit switches are closed: look at their supply, wiring and polarity");
  if (!by_switch) {
    if (limit(sensed, settings.toward))
      return failed("homing ended: the limit switch on its way is closed: move the axis off it by hand");
    return enter(settings.method == Settings::Method::index_pulse ? Phase::index_out : Phase::search, sensed);
  }
  must_pass_ = !closed_ && limit(sensed, settings.toward);
  return enter(closed_ || must_pass_ ? Phase::leave : Phase::search, sensed);
}

Homing::Order Homing::enter(Phase phase, const Sensed& sensed) noexcept {
  phase_ = phase;
  waits_ = false;
  was_closed_ = began_closed_ = closed_;
  began_at_ = sensed.position;
  opened_at_.reset();
  stands_.reset();
  pulses_ = sensed.pulses;
  const bool by_stop = settings_.method == Settings::Method::hard_stop;
  const double whole = settings_.travel + settings_.margin;
  const double toward = settings_.toward;
  double velocity = settings_.creep;
  switch (phase) {
    case Phase::leave:
      way_ = -toward * whole;
      velocity = settings_.search;
      break;
    case Phase::search:
      way_ = toward * whole;
      velocity = settings_.search;
      break;
    case Phase::back:
    case Phase::clear:
      way_ = -toward * (by_stop ? step_back : settings_.margin);
      break;
    case Phase::take:
      way_ = toward * (by_stop ? 2.0 * step_back : settings_.margin);
      break;
    case Phase::index_out:
      way_ = outward() * whole;
      break;
    case Phase::index_return:  // over the pulse and a little more, so that it comes again from the same side
      way_ = -outward() * (std::abs(sensed.position - taken_[0]) + 2.0 * settings_.tolerance);
      break;
  }
  return {Order::Kind::go, way_, velocity};
}

Homing::Order Homing::end_leg(Phase next, Order::Kind how) noexcept {
  waits_ = true;
  next_ = next;
  return {how};
}

/// An edge, pulse or stop was taken; the second must agree with the first.
Homing::Order Homing::took(double at, Phase again, Phase after, const char* what, Order::Kind how) noexcept {
  taken_[static_cast<std::size_t>(takes_++)] = at;
  if (takes_ < 2) return end_leg(again, how);
  takes_ = 0;
  const double apart = std::abs(taken_[1] - taken_[0]);
  if (!(apart <= settings_.tolerance))
    return failed("homing ended: taken twice, the %s lay %.4g mm apart; `homing.tolerance` is %.4g mm", what,
                  1e3 * apart, 1e3 * settings_.tolerance);
  found_ = 0.5 * (taken_[0] + taken_[1]);
  return end_leg(after, how);
}

/// What this phase waits for, where it has happened.
Homing::Order Homing::event(const Sensed& sensed) noexcept {
  using Kind = Order::Kind;
  const bool by_stop = settings_.method == Settings::Method::hard_stop;
  const bool stopped = stands_ && sensed.now - *stands_ >= settings_.stall;
  const bool opened = !closed_ && was_closed_;
  const Phase last = settings_.index && !by_stop ? Phase::index_out : Phase::clear;
  switch (phase_) {
    case Phase::leave:
      if (opened && !opened_at_) opened_at_ = changed_at_;
      if (closed_ && opened_at_)
        return failed("homing ended: the %s is open over %.4g mm only: wrong polarity, or it flickers",
                      switch_name(), 1e3 * std::abs(changed_at_ - *opened_at_));
      if (opened && !limit(sensed, settings_.toward) &&
          std::abs(sensed.position - *opened_at_) >= std::min(settings_.margin, 0.25 * settings_.travel)) {
        left_ = true;
        return end_leg(Phase::search);
      }
      break;
    case Phase::search:
      if (by_stop && stopped) return end_leg(Phase::back, Kind::halt);
      // A limit is not driven past, whatever it will turn out to be.
      if (settings_.method == Settings::Method::limit_switch ? raw_switch(sensed) : closed_)
        return end_leg(left_ ? Phase::back : Phase::leave);
      break;
    case Phase::back:
      if (!by_stop && opened) return end_leg(Phase::take);
      break;
    case Phase::take:
      if (by_stop && stopped) return took(sensed.position, Phase::back, last, "stops", Kind::halt);
      if (!by_stop && closed_ && !began_closed_)
        return took(changed_at_, Phase::back, last, "edges of the switch", Kind::brake);
      break;
    case Phase::index_out:
      if (sensed.pulses != pulses_ && sensed.pulse_at)
        return took(*sensed.pulse_at, Phase::index_return, Phase::clear, "index pulses", Kind::brake);
      break;
    case Phase::index_return:
      break;
    case Phase::clear:
      if (opened) {
        finishing_ = true;
        return end_leg(Phase::clear);
      }
      break;
  }
  return {};
}

/// The whole way of a phase was gone and nothing happened.
Homing::Order Homing::exhausted(const Sensed& sensed) noexcept {
  const double way = 1e3 * std::abs(way_), moved = 1e3 * std::abs(sensed.position - began_at_);
  switch (phase_) {
    case Phase::leave:
      if (must_pass_ && !was_closed_)
        return failed("homing ended: no %s within %.4g mm of the limit switch: it is dead", switch_name(),
                      way);
      if (opened_at_) return failed("homing ended: no room of `homing.margin` beside the %s", switch_name());
      return failed("homing ended: the %s stays closed over %.4g mm: it is stuck or has the wrong polarity",
                    switch_name(), way);
    case Phase::search:
      if (settings_.method == Settings::Method::hard_stop)
        return failed("homing ended: no hard stop within %.4g mm", way);
      return failed("homing ended: no %s within %.4g mm: it is dead, or at the other end", switch_name(),
                    way);
    case Phase::back:
      if (settings_.method != Settings::Method::hard_stop)
        return failed("homing ended: the %s does not open within %.4g mm again", switch_name(), way);
      if (moved < 0.5 * way)
        return failed(
            "homing ended: the axis comes %.3g of %.3g mm off the stop: its drive or encoder is dead", moved,
            way);
      return enter(Phase::take, sensed);
    case Phase::take:
      return failed("homing ended: the %s is not found again within %.4g mm",
                    settings_.method == Settings::Method::hard_stop ? "hard stop" : switch_name(), way);
    case Phase::index_out:
      return failed("homing ended: no index pulse within %.4g mm", way);
    case Phase::index_return:
      return enter(Phase::index_out, sensed);
    case Phase::clear:
      if (closed_)
        return failed("homing ended: the %s does not open within %.4g mm again", switch_name(), way);
      return {Order::Kind::done};
  }
  return {};
}

Homing::Order Homing::finish(const Sensed& sensed) noexcept {
  // Away from what was found, where the axis could not stay.
  const bool stays = settings_.method == Settings::Method::home_switch ||
                     settings_.method == Settings::Method::index_pulse ||
                     (settings_.method == Settings::Method::limit_switch && !closed_);
  if (stays) return {Order::Kind::done};
  return enter(Phase::clear, sensed);
}

Homing::Order Homing::step(const Sensed& sensed) noexcept {
  watch_switch(sensed);
  was_closed_ = was_closed_ || closed_;
  const bool creeps = std::abs(sensed.position - stands_at_) <
                      standing_still * settings_.creep * settings_.stall.in_seconds();
  if (!sensed.pushes || !stands_ || !creeps) {
    stands_.reset();
    if (sensed.pushes) stands_ = sensed.now;
    stands_at_ = sensed.position;
  }
  if (waits_) {
    if (!sensed.at_rest) return {};
    if (finishing_) return {Order::Kind::done};
    return next_ == Phase::clear ? finish(sensed) : enter(next_, sensed);
  }
  const bool is_the_switch =
      settings_.method == Settings::Method::limit_switch && way_ * settings_.toward > 0.0;
  if (limit(sensed, way_) && !is_the_switch) {
    const char* which = way_ < 0.0 ? "lower" : "upper";
    if (phase_ == Phase::leave)
      return failed(
          "homing ended at the %s limit switch: the %s did not %s on the way: it is dead, stuck, or has the "
          "wrong polarity",
          which, switch_name(), must_pass_ && !was_closed_ ? "close" : "open");
    return failed(
        "homing ended at the %s limit switch: what it seeks is dead, at the other end, or was behind it "
        "(home "
        "again from here)",
        which);
  }
  const Order order = event(sensed);
  if (order.kind != Order::Kind::keep) return order;
  return sensed.at_rest ? exhausted(sensed) : order;
}

}  // namespace invar::stage
