#include "components/thermal/heat_watch.hpp"

#include <algorithm>
#include <cmath>

namespace invar::thermal {

namespace {

constexpr double nearly_full = 0.95;  // of full power: a loop at its limit, wherever the reading is
constexpr Duration comparable = Duration::seconds(1.0);  // readings further apart say nothing of a leap
constexpr Duration starting =
    Duration::seconds(2.0);  // a controller that starts may report 0 before it has measured
constexpr Duration second_look = Duration::seconds(2.0);  // a leap that goes away sooner was a bad reading

}  // namespace

bool HeatWatch::trusts(const Settings& settings, std::optional<double> reading, Instant now) noexcept {
  if (!reading) return true;
  if (!begun_at_) begun_at_ = now;
  const bool leaps = trusted_at_ && now - *begun_at_ > starting &&
                     std::abs(*reading - trusted_) > settings.leap &&
                     (leapt_at_ || now - *trusted_at_ <= comparable);
  if (leaps && !leapt_at_) leapt_at_ = now;
  if (leaps) return false;
  leapt_at_.reset();
  trusted_ = *reading;
  trusted_at_ = now;
  return true;
}

void HeatWatch::read(const Settings& settings, double reading, double power) noexcept {
  if (!known_) lowest_ = reading;
  if (!known_ || reading != last_) silent_ = 0.0, power_then_ = power;
  known_ = true;
  last_ = reading;
  lowest_ = std::min(lowest_, reading);
  if (reading - lowest_ < settings.rise) return;
  lowest_ = reading;
  unanswered_ = waited_ = 0.0;
}

HeatWatch::Doubt HeatWatch::look(const Settings& settings, std::optional<double> reading, double setpoint,
                                 double power, Instant now, double period) noexcept {
  if (leapt_at_ && now - *leapt_at_ >= second_look) return Doubt::leapt;
  const double away = looked_at_ ? std::max(0.0, (now - *looked_at_).in_seconds() - period) : 0.0;
  looked_at_ = now;
  // A device that is not reached goes on until its own watchdog acts.
  unreached_ = reading ? 0.0 : unreached_ + period;
  if (reading) last_power_ = power;
  if (!reading) power = std::max(power, unreached_ <= settings.lets_go ? last_power_ : 0.0);
  if (reading) read(settings, *reading, power);
  const double heat = settings.full * settings.within;
  if (!known_ || !(heat > 0.0)) return Doubt::none;

  const double holding = settings.hold * settings.full;
  // Near the setpoint, and not at its limit, a loop may hold with any power.
  const bool warming = setpoint - last_ > settings.rise || power >= nearly_full * settings.full;
  const double counted = warming ? power : std::min(power, holding);
  unanswered_ = std::max(0.0, unanswered_ + (counted - holding) * period - holding * away);
  waited_ = unanswered_ > 0.0 ? waited_ + period + away : 0.0;
  // There the power that holds stays as it is while the reading does.
  if (power > 0.0) silent_ += (warming ? power : std::abs(power - power_then_)) * period;
  constexpr double rounding = 1e-9;
  if (unanswered_ >= (1.0 - rounding) * (1.0 - settings.hold) * heat) return Doubt::unanswered;
  return silent_ >= (1.0 - rounding) * heat ? Doubt::frozen : Doubt::none;
}

}  // namespace invar::thermal
