#include "core/physics/axis_controller.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/contract.hpp"

namespace invar::physics {

namespace {

constexpr double longest_gap = 20.0;  // periods: a drive lets go of a current that nobody renews

}  // namespace

AxisController::AxisController(const AxisControllerSettings& settings)
    : settings_{settings},
      share_{settings.velocity_filter_hz
                 ? -std::expm1(-2.0 * std::numbers::pi * *settings.velocity_filter_hz / settings.rate)
                 : 1.0} {
  INVAR_EXPECTS(settings.rate > 0.0, settings.rate);
}

void AxisController::reset() noexcept {
  sum_ = last_ = rate_of_change_ = 0.0;
  gap_ = 1.0;
  started_ = false;
}

bool AxisController::shift(double current) noexcept {
  if (settings_.kind == AxisControllerSettings::Kind::cascade || !(settings_.ki > 0.0)) return false;
  sum_ += current * settings_.rate / settings_.ki;
  return true;
}

bool AxisController::go_on_from(double command, double error, double periods) noexcept {
  const double soft = 1.0 / std::min(periods, longest_gap);
  return shift(command - soft * soft * settings_.kp * error);
}

void AxisController::remember(double periods) noexcept {
  constexpr double forgotten = 0.1;  // periods, a period: at 0.5 a loop that often loses 20 is unstable
  gap_ = std::max(std::min(periods, longest_gap), gap_ - forgotten);
}

double AxisController::step(double reference, double reading, double periods) noexcept {
  const double error = reference - reading;
  const bool pid = settings_.kind == AxisControllerSettings::Kind::pid;
  const double tracked = pid ? error : reading;
  if (!started_) last_ = tracked, started_ = true;
  const double share = periods > 1.0 ? -std::expm1(periods * std::log1p(-share_)) : share_;
  rate_of_change_ += share * ((tracked - last_) * settings_.rate / periods - rate_of_change_);
  last_ = tracked;
  remember(periods);
  const double soft = 1.0 / gap_;
  const double more = periods * soft * soft * soft * error;  // of the sum
  double command = pid ? soft * soft * settings_.kp * error + settings_.ki * (sum_ + more) / settings_.rate +
                             soft * settings_.kd * rate_of_change_
                       : soft * settings_.kv * (soft * settings_.kp * error - rate_of_change_);
  const double limit = settings_.limit;
  if (limit > 0.0 && std::abs(command) > limit)
    command = command > 0.0 ? limit : -limit;
  else
    sum_ += more;
  return command;
}

}  // namespace invar::physics
