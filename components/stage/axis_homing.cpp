// How a stage carries out what homing orders.
#include <algorithm>
#include <cmath>

#include "components/stage/axis_stage.hpp"

namespace invar::stage {

/// Against a hard stop a stage pushes with less than it has.
double Stage::highest_current() const noexcept {
  constexpr double share = 0.25;
  const double limit = parameters_.control.limit;
  if (mode_ != AXIS_MODE_HOMING || !homing_.presses()) return limit;
  return parameters_.homing.current > 0.0 ? std::min(parameters_.homing.current, limit) : share * limit;
}

Homing::Sensed Stage::sensed(const Tick& tick) noexcept {
  constexpr double nearly = 0.98;
  const auto& feedback = *feedback_.latest();
  Homing::Sensed sensed;
  sensed.now = tick.now;
  sensed.position = position_;
  sensed.home = feedback.home_switch();
  sensed.limit_low = feedback.limit_low();
  sensed.limit_high = feedback.limit_high();
  sensed.pushes = std::abs(current_) >= nearly * highest_current() ||
                  std::abs(following_error_) > parameters_.following_error;
  if (const auto* index = index_.latest(); index != nullptr && std::isfinite(index->position())) {
    sensed.pulses = index->count();
    sensed.pulse_at = position_ + (index->position() - feedback.position());
  }
  sensed.at_rest = has_arrived(tick);
  return sensed;
}

bool Stage::start_homing(const Tick& tick) noexcept {
  if (mode_ != AXIS_MODE_HOLDING) return false;
  homed_ = false;
  const auto order = homing_.start(
      Homing::settings(parameters_.homing, parameters_.homing_velocity, parameters_.travel.width()),
      sensed(tick));
  if (order.kind == Homing::Order::Kind::failed) return false;  // the refusal gives the reason
  carry_out(order, tick);
  return mode_ == AXIS_MODE_HOMING;
}

void Stage::carry_out(const Homing::Order& order, const Tick& tick) noexcept {
  using Kind = Homing::Order::Kind;
  const Limits& own = parameters_.limits;
  const MotionPoint at = setpoint(tick);
  switch (order.kind) {
    case Kind::keep:
      break;
    case Kind::go:
      begin(Trajectory::move(at.position, at.position + order.way,
                             {order.velocity, own.acceleration, own.jerk}),
            tick, AXIS_MODE_HOMING);
      break;
    case Kind::brake:
      begin(Trajectory::stop(at, {own.velocity, own.acceleration, own.jerk}), tick, AXIS_MODE_HOMING);
      break;
    case Kind::halt:  // the stop has halted it already
      controller_.reset();
      begin(Trajectory::rest(position_ - correction_held_), tick, AXIS_MODE_HOMING);
      break;
    case Kind::done: {
      const Range travel = parameters_.travel;
      const double end = parameters_.homing.direction == "positive" ? travel.upper : travel.lower;
      const double shift = parameters_.homing.position.value_or(end) - homing_.found();
      offset_ += shift;
      position_ += shift;
      if (parameters_.control.kind == "cascade") controller_.reset();  // it would see the shift as a speed
      begin(Trajectory::rest(at.position + shift), tick, AXIS_MODE_HOLDING);
      homed_ = true;
      sample_.command_done(true);
      break;
    }
    case Kind::failed:
      notices_.say(event::SEVERITY_FAULT, homing_.reason());
      in_vain_ = true;
      brake(at, tick);
      break;
  }
}

}  // namespace invar::stage
