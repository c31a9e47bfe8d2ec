#include "core/physics/axis_controller.hpp"

#include <cmath>
#include <numbers>

#include "core/base/contract.hpp"

namespace invar::physics {

AxisController::AxisController(const AxisControllerSettings& settings)
    : settings_{settings},
      share_{settings.velocity_filter_hz
                 ? -std::expm1(-2.0 * std::numbers::pi * *settings.velocity_filter_hz / settings.rate)
                 : 1.0} {
  INVAR_EXPECTS(settings.rate > 0.0, settings.rate);
}

void AxisController::reset() noexcept {
  sum_ = last_ = rate_of_change_ = 0.0;
  started_ = false;
}

bool AxisController::shift(double current) noexcept {
  if (settings_.kind == AxisControllerSettings::Kind::cascade || !(settings_.ki > 0.0)) return false;
  sum_ += current * settings_.rate / settings_.ki;
  return true;
}

double AxisController::step(double reference, double reading) noexcept {
  const double error = reference - reading;
  const bool pid = settings_.kind == AxisControllerSettings::Kind::pid;
  const double tracked = pid ? error : reading;
  if (!started_) last_ = tracked, started_ = true;
  rate_of_change_ += share_ * ((tracked - last_) * settings_.rate - rate_of_change_);
  last_ = tracked;
  double command = pid ? settings_.kp * error + settings_.ki * (sum_ + error) / settings_.rate +
                             settings_.kd * rate_of_change_
                       : settings_.kv * (settings_.kp * error - rate_of_change_);
  const double limit = settings_.limit;
  if (limit > 0.0 && std::abs(command) > limit)
    command = command > 0.0 ? limit : -limit;
  else
    sum_ += error;
  return command;
}

}  // namespace invar::physics
