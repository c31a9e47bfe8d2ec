#include "components/stage/axis_stage.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "core/compensation/model_file.hpp"
#include "core/model/model_file.hpp"
#include "core/physics/axis_stability.hpp"

namespace invar::stage {

namespace {

physics::AxisControllerSettings settings(const Stage::Control& control, double period) {
  using Kind = physics::AxisControllerSettings::Kind;
  physics::AxisControllerSettings result;
  result.kind = control.kind == "cascade" ? Kind::cascade : Kind::pid;
  result.rate = 1.0 / period;
  result.kp = control.kp;
  result.ki = control.ki;
  result.kd = control.kd;
  result.kv = control.kv;
  result.velocity_filter_hz = control.velocity_filter;
  result.limit = control.limit;
  return result;
}

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
}

std::vector<Component::Claim> Stage::claims() const {
  return {{"axis " + std::to_string(parameters_.axis), "axis"}};
}

std::optional<Component::Unfit> Stage::unfit(double period) const {
  const Control& control = parameters_.control;
  if (!(control.feedforward_acceleration > 0.0)) return {};
  const double radius = physics::spectral_radius(settings(control, period), control.feedforward_acceleration,
                                                 control.feedforward_velocity);
  if (radius < 1.0) return {};
  std::array<char, 160> why{};
  std::snprintf(why.data(), why.size(),
                "with these gains the loop swings up when it runs at %.6g Hz (by %.3g times a period)",
                1.0 / period, radius);
  return Unfit{why.data(), "control", "step it more often, or lower kp, ki and kd (in a cascade kp and kv)"};
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
  model_changed_ = false;
  model_.announce();
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
                  "axis %lld is let go of while it moves at %.4g m/s: it did not come to rest in time",
                  static_cast<long long>(parameters_.axis), sample_.velocity());
    notices_.say(event::SEVERITY_TRIP, text.data());
  }
  mode_ = AXIS_MODE_DISABLED;
}

bool Stage::wind_down() noexcept {
  leaving_ = true;
  return mode_ == AXIS_MODE_DISABLED || mode_ == AXIS_MODE_FAULT || mode_ == AXIS_MODE_HOLDING;
}

void Stage::begin(const Trajectory& trajectory, const Tick& tick, AxisMode mode) noexcept {
  trajectory_ = trajectory;
  trajectory_start_ = tick.now;
  mode_ = mode;
}

MotionPoint Stage::setpoint(const Tick& tick) const noexcept {
  return trajectory_.at((tick.now - trajectory_start_).in_seconds());
}

/// Setpoint := measured, so that nothing moves on activation or enabling.
void Stage::prime(const Tick& tick) noexcept {
  controller_ = physics::AxisController{settings(parameters_.control, tick.period)};
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
  if (command.kind() == AXIS_COMMAND_MOVE) {
    const Range travel = parameters_.travel;
    const auto move = Trajectory::move(setpoint(tick).position, command.position(), limits);
    if (!standing || !homed_ || !travel.contains(command.position()) || !ends(move)) return false;
    begin(move, tick, AXIS_MODE_MOVING);
    return true;
  }
  const double beyond = setpoint(tick).position - 1.5 * parameters_.travel.width();
  const auto home = Trajectory::move(setpoint(tick).position, beyond,
                                     {parameters_.homing_velocity, limits.acceleration, limits.jerk});
  if (!standing || !ends(home)) return false;
  begin(home, tick, AXIS_MODE_HOMING);
  homed_ = false;
  return true;
}

void Stage::obey(const AxisCommand& command, const Tick& tick) noexcept {
  bool accepted = true;
  bool done = true;
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
    case AXIS_COMMAND_HOME:
      accepted = start_move(command, tick);
      done = !accepted;
      break;
    case AXIS_COMMAND_SINE:
      accepted = start_sine(command, tick);
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
  sample_.command_id(command.id());
  sample_.command_refused(!accepted);
  sample_.command_done(done);
}

void Stage::brake(const MotionPoint& from, const Tick& tick) noexcept {
  const Limits& own = parameters_.limits;
  begin(Trajectory::stop(from, {own.velocity, own.acceleration, own.jerk}), tick, AXIS_MODE_STOPPING);
}

/// Lets go of the motor and says why.
void Stage::trip(const char* why) noexcept {
  mode_ = AXIS_MODE_FAULT;
  disabling_ = false;
  fed_forward_ = {};
  notices_.say(event::SEVERITY_TRIP, why);
}

/// What of the inputs is no number; nullptr: nothing.
const char* Stage::unusable(const AxisFeedback& feedback) noexcept {
  const auto* fused = fused_.latest();
  const auto* correction = correction_.latest();
  if (!std::isfinite(feedback.position()) || !std::isfinite(feedback.velocity()))
    return "braked without feedback and tripped: the encoder's position or velocity is not a number";
  if (fused != nullptr && fused->valid() && !std::isfinite(fused->position()))
    return "braked without feedback and tripped: the fused position is not a number";
  if (correction != nullptr && !std::isfinite(correction->correction()))
    return "braked without feedback and tripped: the correction is not a number";
  return nullptr;
}

/// Feedback is gone: brake along the stopping trajectory on feedforward alone, then let go.
void Stage::stop_blindly(const char* why, const Tick& tick) noexcept {
  if (!blind_) {
    blind_ = true;
    blind_because_ = why;
    brake(setpoint(tick), tick);
  }
  if ((tick.now - trajectory_start_).in_seconds() >= trajectory_.duration()) trip(blind_because_);
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

/// What ends a motion: the home switch, the end of the trajectory, a following error, a limit switch or the drive.
void Stage::supervise(const Tick& tick) noexcept {
  const auto& feedback = *feedback_.latest();
  const double velocity = setpoint(tick).velocity;
  const bool at_limit = (feedback.limit_low() && velocity < 0.0 && mode_ == AXIS_MODE_MOVING) ||
                        (feedback.limit_high() && velocity > 0.0);
  const char* why = nullptr;
  if (at_limit) why = "tripped: it runs into a limit switch";
  if (!(std::abs(following_error_) <= parameters_.following_error))
    why = "tripped: the following error is above `following_error`";
  if (feedback.drive_fault()) why = "tripped: its drive reports a fault";
  if (!std::isfinite(current_)) why = "tripped: the current that it worked out is not a number";
  if (why != nullptr) return trip(why);
  if (mode_ == AXIS_MODE_HOMING && feedback.home_switch()) {
    const double shift = parameters_.travel.lower - position_;
    MotionPoint from = setpoint(tick);
    from.position += shift;
    offset_ += shift;
    position_ += shift;
    controller_.reset();
    homed_ = true;
    brake(from, tick);
  }
  if ((tick.now - trajectory_start_).in_seconds() >= trajectory_.duration() && mode_ != AXIS_MODE_HOLDING) {
    if (mode_ == AXIS_MODE_HOMING) {  // travelled the whole way and never saw the switch
      sample_.command_refused(true);
    }
    mode_ = disabling_ ? AXIS_MODE_DISABLED : AXIS_MODE_HOLDING;
    disabling_ = false;
    sample_.command_done(true);
  }
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
  const bool seeing = seen_ && tick.now - *seen_ <= patience;
  model_changed_ = model_.update();
  if (seeing && usable) read_position(*feedback, tick);
  // A correction that stays away is held where it was: no step.
  if (const auto* correction = correction_.latest(); correction != nullptr && bad == nullptr)
    correction_held_ = correction->correction();
  if (seeing && !primed_) prime(tick);

  AxisCommand command;
  while (command_.take(command)) {
    if ((seeing && !leaving_) || command.kind() == AXIS_COMMAND_DISABLE) {
      obey(command, tick);
    } else {
      sample_.command_id(command.id());
      sample_.command_refused(true);
      sample_.command_done(true);
    }
  }

  if (leaving_ && (mode_ == AXIS_MODE_MOVING || mode_ == AXIS_MODE_HOMING)) brake(setpoint(tick), tick);
  // At rest and about to leave, a plant that has left before is no fault.
  if (leaving_ && !seeing && mode_ == AXIS_MODE_HOLDING) mode_ = AXIS_MODE_DISABLED;
  const bool driving = mode_ != AXIS_MODE_DISABLED && mode_ != AXIS_MODE_FAULT;
  if (driving && !seeing) {
    stop_blindly(
        bad != nullptr ? bad : "braked without feedback and tripped: none came for `feedback_timeout`", tick);
    current_ = feedforward(tick);
    if (!std::isfinite(current_)) trip("tripped: the current that it worked out is not a number");
  } else if (driving && blind_) {
    trip(blind_because_);         // sight came back too late: stay stopped until somebody clears the fault
  } else if (driving && fresh) {  // a missing sample is no motion: without one the current is held
    const MotionPoint at = setpoint(tick);
    following_error_ = at.position + correction_held_ - position_;
    const double forward = feedforward(tick);
    const double feedback_current = controller_.step(at.position + correction_held_, position_);
    current_ = std::clamp(feedback_current + forward, -parameters_.control.limit, parameters_.control.limit);
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
