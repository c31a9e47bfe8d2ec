#include "components/stage/axis_stage.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <utility>

#include "components/stage/command_check.hpp"
#include "core/compensation/model_file.hpp"
#include "core/model/model_file.hpp"

namespace invar::stage {

namespace {

double chosen(double asked, double own) { return asked > 0.0 ? std::min(asked, own) : own; }

/// Limits of a command may be so small that numbers cannot tell the way any more.
bool are_usable(const MotionLimits& asked, const Stage::Limits& own) {
  constexpr double least = 1e-9;
  return asked.velocity >= least * own.velocity && asked.acceleration >= least * own.acceleration &&
         asked.jerk >= least * own.jerk;
}

/// ... or that it takes for ever.
bool ends(const Trajectory& trajectory) {
  constexpr double longest = 1e6;  // s
  return trajectory.duration() <= longest;
}

}  // namespace

Stage::Stage(const Parameters& parameters)
    : parameters_{parameters},
      model_{*this,
             [this](const std::filesystem::path& file, Staged::Model& model) { return load(file, model); },
             "model", "model_status"} {
  MotorCommand released;
  released.current(0.0);
  released.enabled(false);
  released.axis(static_cast<std::uint32_t>(parameters.axis));
  motor_.set_safe_value(released);
  for (Port* port : {static_cast<Port*>(&index_), static_cast<Port*>(&feedback_), static_cast<Port*>(&fused_),
                     static_cast<Port*>(&correction_), static_cast<Port*>(&command_),
                     static_cast<Port*>(&motor_), static_cast<Port*>(&state_)})
    port->key = static_cast<std::uint32_t>(parameters.axis);
}

std::vector<Component::Claim> Stage::claims() const {
  return {{"axis " + std::to_string(parameters_.axis), "axis"}};
}

void Stage::activate() {
  mode_ = AXIS_MODE_DISABLED;
  primed_ = false;
  blind_ = leaving_ = disabling_ = false;
  seen_.reset();
  homed_ = parameters_.absolute_encoder;
  offset_ = 0.0;
  current_ = 0.0;
  correction_held_ = 0.0;
  settled_ = false;
  fed_forward_ = reading_error_ = {};
  fused_watch_.reset(fused_.received());
  correction_watch_.reset(correction_.received());
  without_correction_ = without_commander_ = in_vain_ = false;
  standing_current_ = 0.0;
  model_changed_ = false;
  unanswered_ = {};
  standby_.activate();
  if (standby_.leads()) model_.announce();
}

/// Why this model must not drive the axis; empty: nothing.
std::string Stage::load(const std::filesystem::path& file, Staged::Model& staged) const {
  const auto yaml = config::Yaml::load(file);
  const auto model = model::read(yaml);
  yaml.finish();
  if (model.plant != physics::Plant::axis)
    return "it is a model of plant " + std::string{physics::name_of(model.plant)} + ", not of an axis";
  staged.content = physics::AxisFeedforward{model};
  const std::string seal = compensation::checksum(model::patched(yaml, model));
  (void)std::from_chars(seal.data(), seal.data() + seal.size(), staged.checksum, 16);
  // At rest and at speed, everywhere in the travel, there must be current left for the servo.
  for (const double velocity : {0.0, parameters_.limits.velocity, -parameters_.limits.velocity})
    for (int i = 0; i <= 500; ++i) {
      const double at = parameters_.travel.lower + parameters_.travel.width() * i / 500.0;
      staged.content.reset(at);
      if (const double current = staged.content.current({at, velocity, 0.0});
          !(std::abs(current) <= 0.8 * parameters_.control.limit))
        return "it feeds forward " + std::to_string(current) + " A at " + std::to_string(at) +
               " m; at most 0.8 of the limit may be needed";
    }
  staged.content.reset(parameters_.travel.lower);
  return {};
}

double Stage::Faded::operator()(double value, bool changed, double period) noexcept {
  constexpr double fading = 0.25;  // s
  if (changed) rest = last - value;
  rest -= rest * std::min(1.0, period / fading);
  return last = value + rest;
}

bool Stage::moves() const noexcept {
  return mode_ == AXIS_MODE_MOVING || mode_ == AXIS_MODE_HOMING || mode_ == AXIS_MODE_STOPPING;
}

void Stage::deactivate() noexcept {
  if (moves()) {
    std::array<char, 160> text{};
    std::snprintf(text.data(), text.size(),
                  "axis %lld is disabled while it moves at %.4g m/s: it did not come to rest in time",
                  static_cast<long long>(parameters_.axis), sample_.velocity());
    notices_.say(event::SEVERITY_TRIP, text.data());
  }
  mode_ = AXIS_MODE_DISABLED;
  standby_.resign();
}

bool Stage::wind_down() noexcept {
  leaving_ = true;
  standby_.leave();
  return mode_ == AXIS_MODE_DISABLED || mode_ == AXIS_MODE_FAULT || mode_ == AXIS_MODE_HOLDING;
}

void Stage::begin(const Trajectory& trajectory, const Tick& tick, AxisMode mode) noexcept {
  trajectory_ = trajectory;
  trajectory_start_ = tick.now;
  mode_ = mode;
}

bool Stage::has_arrived(const Tick& tick) const noexcept {
  return (tick.now - trajectory_start_).in_seconds() >= trajectory_.duration();
}

MotionPoint Stage::setpoint(const Tick& tick) const noexcept {
  return trajectory_.at((tick.now - trajectory_start_).in_seconds());
}

/// How long [s] after `begin` on its trajectory, `most` at most, the setpoint comes nearest to `place`.
double Stage::time_along(double begin, double most, double place) const noexcept {
  constexpr int parts = 32;  // of a stall, then of the two parts about the nearest place, and of two of those
  double nearest = 0.0, least = std::numeric_limits<double>::infinity(), from = 0.0, width = most;
  for (int round = 0; round < 3; ++round) {
    for (int part = 0; part <= parts; ++part) {
      const double time = std::clamp(from + width * part / parts, 0.0, most);
      const double off = std::abs(trajectory_.at(begin + time).position - place);
      if (off < least) least = off, nearest = time;
    }
    from = nearest - width / parts;
    width = 2.0 * width / parts;
  }
  return nearest;
}

/// While a loop stands still its carriage drives on with the last current, until the drive lets go of it. The setpoint goes on from
/// where on its way the carriage is, so that neither leaps after the other.
void Stage::rejoin_after_stall(const Tick& tick, bool fresh) noexcept {
  constexpr double periods = 8.0;  // as many as the overrun policy `degrade` leaves out
  const double gone = last_step_ ? (tick.now - *last_step_).in_seconds() : tick.period;
  if (gone > periods * tick.own_period) {
    const double most = gone - tick.period;
    const double begin = (*last_step_ - trajectory_start_).in_seconds() + tick.period;
    const double place = position_ - correction_held_ + following_error_;
    const double went = fresh ? time_along(begin, most, place) : 0.0;
    trajectory_start_ = trajectory_start_ + Duration::seconds(most - went);
  }
  last_step_ = tick.now;
}

void Stage::begin_control(const Tick& tick) noexcept {
  controller_ = physics::AxisController{controller_settings(tick.own_period)};
  controlled_at_ = tick.now - Duration::seconds(tick.period);
}

/// The current is held through skipped cycles, and while no feedback comes. A step of a lowered rate may last 4/3 of its own period.
double Stage::control(const MotionPoint& at, const Tick& tick) noexcept {
  constexpr double of_the_clock = 0.05;  // periods
  const Duration gone = tick.now - std::exchange(controlled_at_, tick.now);
  double periods = std::max(1.0, gone.in_seconds() * controller_.rate());
  if (std::abs(periods - std::round(periods)) < of_the_clock) periods = std::round(periods);
  return controller_.step(at.position + correction_held_, position_, periods);
}

/// Setpoint := measured, so that nothing moves on activation or enabling.
void Stage::prime(const Tick& tick) noexcept {
  begin_control(tick);
  begin(Trajectory::rest(position_ - correction_held_), tick, mode_);
  outside_at_ = tick.now;
  primed_ = true;
}

bool Stage::start_sine(const AxisCommand& command, const Tick& tick) noexcept {
  const double from = setpoint(tick).position;
  const double frequency = 2.0 * std::numbers::pi / command.period();
  const double speed = std::abs(command.amplitude()) * frequency;
  const bool possible = command.period() > 0.0 && command.periods() > 0 &&
                        speed <= parameters_.limits.velocity &&
                        speed * frequency <= parameters_.limits.acceleration;
  const Range travel = parameters_.travel;
  const auto sine = Trajectory::sine(from, command.amplitude(), command.period(), command.periods());
  if (mode_ != AXIS_MODE_HOLDING || !homed_ || !possible || !ends(sine) || !travel.contains(from) ||
      !travel.contains(from + 2.0 * command.amplitude()))
    return false;
  begin(sine, tick, AXIS_MODE_MOVING);
  return true;
}

bool Stage::start_move(const AxisCommand& command, const Tick& tick) noexcept {
  const Limits& own = parameters_.limits;
  const MotionLimits limits{chosen(command.velocity(), own.velocity),
                            chosen(command.acceleration(), own.acceleration),
                            chosen(command.jerk(), own.jerk)};
  const bool standing = mode_ == AXIS_MODE_HOLDING;
  if (!are_usable(limits, own)) return false;
  const Range travel = parameters_.travel;
  const auto move = Trajectory::move(setpoint(tick).position, command.position(), limits);
  if (!standing || !homed_ || !travel.contains(command.position()) || !ends(move)) return false;
  begin(move, tick, AXIS_MODE_MOVING);
  return true;
}

/// Answers a command that is not carried out. The same reason is told once a second at most: whoever sends commands in a loop
/// must not fill the log.
const char* Stage::why_not(const AxisCommand& command) const noexcept {
  if (without_correction_) return "the correction that the axis needs has stopped coming";
  const bool could_home = command.kind() == AXIS_COMMAND_HOME && mode_ == AXIS_MODE_HOLDING;
  return could_home ? homing_.reason() : why_refused(command, mode_, homed_, parameters_.travel);
}

void Stage::refuse(const AxisCommand& command, const char* why, const Tick& tick) noexcept {
  sample_.command_id(command.id());
  sample_.command_refused(true);
  sample_.command_done(true);
  if (why == refused_because_ && tick.now - refused_at_ < Duration::seconds(1.0)) return;
  refused_because_ = why;
  refused_at_ = tick.now;
  const NumberFault number = fault_in(command);
  std::array<char, 300> text{};
  if (number.member != nullptr)
    std::snprintf(text.data(), text.size(), "%s (command %llu) is refused: its %s is %g; send %s",
                  kind_text(command.kind()), static_cast<unsigned long long>(command.id()), number.member,
                  number.value, number.want);
  else
    std::snprintf(text.data(), text.size(), "%s (command %llu) is refused: %s", kind_text(command.kind()),
                  static_cast<unsigned long long>(command.id()), why);
  notices_.say(event::SEVERITY_WARNING, text.data());
}

void Stage::obey(const AxisCommand& command, const Tick& tick) noexcept {
  if (const NumberFault number = fault_in(command); number.member != nullptr)
    return refuse(command, number.member, tick);
  bool accepted = true;
  bool done = true;
  in_vain_ = false;
  switch (command.kind()) {
    case AXIS_COMMAND_ENABLE:
      accepted = mode_ == AXIS_MODE_DISABLED || mode_ == AXIS_MODE_HOLDING;
      if (mode_ == AXIS_MODE_DISABLED) {
        prime(tick);
        mode_ = AXIS_MODE_HOLDING;
      }
      break;
    case AXIS_COMMAND_DISABLE:
      if (moves()) {
        disabling_ = true;
        if (mode_ != AXIS_MODE_STOPPING) brake(setpoint(tick), tick);
        done = false;
      } else if (mode_ != AXIS_MODE_FAULT) {
        mode_ = AXIS_MODE_DISABLED;
      }
      break;
    case AXIS_COMMAND_MOVE:
      accepted = !without_correction_ && start_move(command, tick);
      done = !accepted;
      break;
    case AXIS_COMMAND_HOME:
      accepted = !without_correction_ && start_homing(tick);
      done = !accepted;
      break;
    case AXIS_COMMAND_SINE:
      accepted = !without_correction_ && start_sine(command, tick);
      done = !accepted;
      break;
    case AXIS_COMMAND_STOP:
      if (mode_ == AXIS_MODE_MOVING || mode_ == AXIS_MODE_HOMING) brake(setpoint(tick), tick);
      break;
    case AXIS_COMMAND_CLEAR_FAULT:
      if (mode_ == AXIS_MODE_FAULT) mode_ = AXIS_MODE_DISABLED;
      blind_ = false;
      break;
  }
  if (!accepted) return refuse(command, why_not(command), tick);
  sample_.command_id(command.id());
  sample_.command_refused(false);
  sample_.command_done(done);
}

void Stage::brake(const MotionPoint& from, const Tick& tick) noexcept {
  const Limits& own = parameters_.limits;
  begin(Trajectory::stop(from, {own.velocity, own.acceleration, own.jerk}), tick, AXIS_MODE_STOPPING);
}

/// Lets go of the motor and says why.
void Stage::trip(const char* why) noexcept {
  if (mode_ == AXIS_MODE_HOMING) {
    sample_.command_refused(true);
    sample_.command_done(true);
  }
  mode_ = AXIS_MODE_FAULT;
  disabling_ = false;
  fed_forward_ = {};
  notices_.say(event::SEVERITY_TRIP, why);
}

double Stage::feedforward(const Tick& tick) noexcept {
  const Control& control = parameters_.control;
  MotionPoint at = setpoint(tick);
  double current =
      control.feedforward_velocity * at.velocity + control.feedforward_acceleration * at.acceleration;
  if (auto* model = model_.active()) {
    auto& axis = model->content;
    at = trajectory_.at((tick.now - trajectory_start_).in_seconds() + axis.lead());
    current = axis.current({at.position + correction_held_ - offset_, at.velocity, at.acceleration});
  }
  // What the sum has learnt already and the model now brings must not count twice.
  const bool taken_over = model_changed_ && controller_.shift(fed_forward_.last - current);
  if (taken_over) fed_forward_.rest = 0.0;
  return std::clamp(fed_forward_(current, model_changed_ && !taken_over, tick.period), -control.limit,
                    control.limit);
}

void Stage::read_position(const AxisFeedback& feedback, const Tick& tick) noexcept {
  const auto* model = model_.active();
  const double error = model != nullptr ? model->content.reading_error(feedback.position()) : 0.0;
  const double known = reading_error_(error, model_changed_, tick.period);
  const auto* fused = fused_.latest();
  position_ =
      (fused != nullptr && fused->valid() ? fused->position() : feedback.position() - known) + offset_;
}

/// What ends a motion: the end of the trajectory, a following error, a limit switch or the drive.
void Stage::supervise(const Tick& tick) noexcept {
  const auto& feedback = *feedback_.latest();
  constexpr double pressing = 5.0;  // times the following error: what a hard stop is pressed with
  const bool presses = mode_ == AXIS_MODE_HOMING && homing_.presses();
  const char* why = nullptr;
  if (!(std::abs(following_error_) <= parameters_.following_error * (presses ? pressing : 1.0)))
    why = "tripped: the following error is above `following_error`";
  if (feedback.drive_fault()) why = "tripped: its drive reports a fault";
  if (!std::isfinite(current_)) why = "tripped: the current that it worked out is not a number";
  if (why != nullptr) return trip(why);
  if (mode_ == AXIS_MODE_HOMING) return carry_out(homing_.step(sensed(tick)), tick);
  stop_at_limit(feedback, tick);
  if (has_arrived(tick) && mode_ != AXIS_MODE_HOLDING) {
    mode_ = disabling_ ? AXIS_MODE_DISABLED : AXIS_MODE_HOLDING;
    disabling_ = false;
    sample_.command_done(true);
    if (std::exchange(in_vain_, false)) sample_.command_refused(true);
  }
}

/// A limit switch that closes ahead ends the motion under control: with the drive disabled, the carriage would coast on past it.
void Stage::stop_at_limit(const AxisFeedback& feedback, const Tick& tick) noexcept {
  const double velocity = setpoint(tick).velocity;
  const bool low = feedback.limit_low() && velocity < 0.0;
  if (mode_ != AXIS_MODE_MOVING || !(low || (feedback.limit_high() && velocity > 0.0))) return;
  notices_.say(event::SEVERITY_FAULT,
               low ? "stopped: the lower limit switch is closed; only moves upwards are taken"
                   : "stopped: the upper limit switch is closed; only moves downwards are taken");
  in_vain_ = true;
  brake(setpoint(tick), tick);
}

void Stage::track_settling(const Tick& tick, const MotionPoint& at) noexcept {
  const bool inside = mode_ == AXIS_MODE_HOLDING && at.velocity == 0.0 &&
                      std::abs(following_error_) <= parameters_.settle_window;
  if (!inside) outside_at_ = tick.now;
  settled_ = inside && tick.now - outside_at_ >= Duration::seconds(parameters_.settle_time);
}

void Stage::step(const Tick& tick) noexcept {
  const auto* feedback = feedback_.latest();
  const Duration patience = Duration::seconds(parameters_.feedback_timeout);
  // What is no number has not come: one is bridged, more of them are a loss.
  const char* bad = feedback != nullptr ? unusable(*feedback) : nullptr;
  const bool usable = feedback != nullptr && bad == nullptr;
  if (usable) seen_ = feedback_.arrived();
  const bool fresh = usable && feedback_.received() != received_;
  received_ = feedback_.received();
  const double forgiven = parameters_.feedback_timeout / tick.period;
  const bool fused_lost = fused_watch_.lost(fused_.received(), forgiven);
  const bool seeing = seen_ && tick.now - *seen_ <= patience && !fused_lost;
  if (standby_.leads())
    model_changed_ = model_.update();
  else
    model_.stand_by();
  if (seeing && usable) read_position(*feedback, tick);
  // A correction that stays away is held where it was: no step.
  if (const auto* correction = correction_.latest(); correction != nullptr && bad == nullptr)
    correction_held_ = correction->correction();
  if (seeing && !primed_) prime(tick);
  rejoin_after_stall(tick, fresh);
  look_for_correction(tick);
  if (!leads(tick, seeing)) return stand_by(tick, seeing);

  AxisCommand command;
  while (command_.take(command)) {
    if ((seeing && !leaving_) || command.kind() == AXIS_COMMAND_DISABLE) {
      obey(command, tick);
    } else {
      refuse(command,
             leaving_ ? "the axis is being deactivated" : "the axis has no feedback that it could go by",
             tick);
    }
  }

  look_for_commander(tick);
  if (leaving_ && (mode_ == AXIS_MODE_MOVING || mode_ == AXIS_MODE_HOMING)) brake(setpoint(tick), tick);
  // At rest and about to leave, a plant that has left before is no fault.
  if (leaving_ && !seeing && mode_ == AXIS_MODE_HOLDING) mode_ = AXIS_MODE_DISABLED;
  const bool driving = mode_ != AXIS_MODE_DISABLED && mode_ != AXIS_MODE_FAULT;
  if (driving && !seeing) {
    stop_blindly(bad != nullptr ? bad
                 : fused_lost   ? "the fused position stays away"
                                : "none came for `feedback_timeout`",
                 tick);
    if (!std::isfinite(current_)) trip("tripped: the current that it worked out is not a number");
  } else if (driving && blind_) {
    see_again(*feedback, tick);
  } else if (driving && fresh) {  // a missing sample is no motion: without one the current is held
    const MotionPoint at = setpoint(tick);
    following_error_ = at.position + correction_held_ - position_;
    const double forward = feedforward(tick);
    const double feedback_current = control(at, tick);
    current_ = std::clamp(feedback_current + forward, -highest_current(), highest_current());
    constexpr double remembers = 0.05;  // s
    if (mode_ == AXIS_MODE_HOLDING)
      standing_current_ += std::min(1.0, tick.period / remembers) * (feedback_current - standing_current_);
    supervise(tick);
  }
  const bool enabled = mode_ != AXIS_MODE_DISABLED && mode_ != AXIS_MODE_FAULT;
  if (!enabled) {
    current_ = 0.0;
    begin(Trajectory::rest(position_ - correction_held_), tick, mode_);
    following_error_ = 0.0;
  }
  const MotionPoint at = setpoint(tick);
  track_settling(tick, at);

  MotorCommand motor;
  stamp(motor);
  motor.axis(static_cast<std::uint32_t>(parameters_.axis));
  motor.current(current_);
  motor.enabled(enabled);
  motor_.write(motor);
  publish(at);
  standby_.tell(*this);
}

void Stage::publish(const MotionPoint& at) noexcept {
  stamp(sample_);
  sample_.axis(static_cast<std::uint32_t>(parameters_.axis));
  sample_.setpoint_position(at.position);
  sample_.setpoint_velocity(at.velocity);
  sample_.setpoint_acceleration(at.acceleration);
  sample_.position(position_);
  if (const auto* feedback = feedback_.latest(); feedback != nullptr && std::isfinite(feedback->velocity()))
    sample_.velocity(feedback->velocity());
  sample_.current(current_);
  sample_.correction(correction_held_);
  sample_.following_error(following_error_);
  sample_.mode(mode_);
  sample_.homed(homed_);
  sample_.moving(moves());
  sample_.enabled(mode_ != AXIS_MODE_DISABLED && mode_ != AXIS_MODE_FAULT);
  sample_.settled(settled_);
  state_.write(sample_);
}

}  // namespace invar::stage
