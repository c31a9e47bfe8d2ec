#include "core/physics/axis_plant.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/base/contract.hpp"
#include "core/physics/terms/axis/backlash.hpp"
#include "core/physics/terms/axis/presliding_friction.hpp"

namespace invar::physics {

namespace {

constexpr double sixth = 1.0 / 6.0;  // of Runge and Kutta's mean

enum Variable { position, velocity, time, current, temperature, acceleration };

int code_of(const std::string& name) {
  if (name == "velocity" || name == "speed" || name == "direction") return velocity;
  if (name == "time") return time;
  if (name == "current") return current;
  if (name == "temperature") return temperature;
  return position;
}

}  // namespace

AxisPlant::AxisPlant(const AxisParameters& parameters, std::vector<AxisTerm> terms, double longest_step)
    : parameters_{parameters}, terms_{std::move(terms)} {
  INVAR_EXPECTS(parameters.mass > 0.0 && longest_step > 0.0, parameters.mass, longest_step);
  double fastest = parameters.viscous_damping / parameters.mass;  // [1/s] of everything that swings or decays
  for (const auto& term : terms_) {
    const auto& p = term.parameters;
    if (term.kind->force != nullptr) forces_.push_back({term.kind->force, p.data()});
    if (term.kind->motor != nullptr) motors_.push_back({term.kind->motor, p.data()});
    if (term.kind->command != nullptr) commands_.push_back(&term);
    if (term.kind->friction != nullptr) frictions_.push_back({term.kind->friction, p.data()});
    if (term.kind->reading != nullptr) readings_.push_back({term.kind->reading, p.data()});
    if (term.curve.memory != Curve::Memory::none) {
      remembering_.emplace_back(&term, CurveMemory{});
      fastest = std::max(fastest, std::sqrt(CurveMemory::stiffness(term.curve) / parameters.mass));
    } else if (!term.curve.knots.empty()) {
      auto& curves = term.acts == CurveActs::as_current       ? command_curves_
                     : term.kind->info->site == "actuator"    ? motor_curves_
                     : term.kind->info->site == "measurement" ? reading_curves_
                     : term.acts == CurveActs::as_friction    ? friction_curves_
                     : term.acts == CurveActs::as_damping     ? damping_curves_
                     : term.acts == CurveActs::as_mass        ? mass_curves_
                                                              : force_curves_;
      curves.emplace_back(&term, code_of(term.curve.over));
      if (term.acts == CurveActs::as_damping)
        for (const double damping : term.curve.values)
          fastest = std::max(fastest, (parameters.viscous_damping + std::abs(damping)) / parameters.mass);
    }
    switch (term.kind->memory) {
      case AxisMemory::none:
        break;
      case AxisMemory::transport_delay:
        delay_ += std::max(0.0, p[0]);
        break;
      case AxisMemory::amplifier_lag:
        lag_ = std::max(lag_, p[0]);
        break;
      case AxisMemory::measurement_delay:
        age_ += std::max(0.0, p[0]);
        break;
      case AxisMemory::backlash:
        play_ = &term;
        break;
      case AxisMemory::presliding:
        if (bristles_.size() < bristle_.size()) bristles_.push_back(&term);
        fastest = std::max(fastest, std::sqrt(p[1] / parameters.mass));
        break;
      case AxisMemory::flexible_mode: {
        const double share = std::clamp(p[0], 0.0, 0.95);
        const double omega = 2.0 * std::numbers::pi * p[1];
        const double mass = share * parameters.mass;
        mode_ = {share, mass * omega * omega, 2.0 * mass * p[2] * omega};
        if (share > 0.0) fastest = std::max(fastest, omega / std::sqrt(1.0 - share));
        break;
      }
    }
    // What repeats must be sampled: at 1 m/s along the way, at its frequency in time.
    if (const auto pitch = term.kind->info->index_of("pitch");
        pitch < most_parameters && term.kind->reading == nullptr)
      fastest = std::max(fastest, 2.0 / p[pitch]);
    if (term.kind->info->name == "periodic_disturbance") fastest = std::max(fastest, 4.0 * p[1]);
    if (term.kind->info->name == "position_stiffness")
      fastest = std::max(fastest, std::sqrt(std::abs(p[0]) / parameters.mass));
  }
  per_carriage_mass_ = 1.0 / (parameters.mass * (1.0 - mode_.share));
  if (mode_.share > 0.0) per_swinging_mass_ = 1.0 / (parameters.mass * mode_.share);
  has_motor_terms_ = !motors_.empty() || !motor_curves_.empty();
  has_force_terms_ = !forces_.empty() || !force_curves_.empty() || !damping_curves_.empty() ||
                     !bristles_.empty() || !remembering_.empty();
  // A history of 256 steps must cover the delays.
  const double oldest = static_cast<double>(Past::size - 8) * longest_step;
  delay_ = std::min(delay_, oldest);
  age_ = std::min(age_, oldest);
  // Runge-Kutta of fourth order errs by (omega h)^5/120 a step.
  if (fastest > 0.0) longest_substep_ = std::clamp(0.4 / fastest, 1e-4, 1e-3);
  // A lagging current counts by its mean over a sub-step: exact for the velocity, of second order for the way.
  if (lag_ > 0.0) longest_substep_ = std::min(longest_substep_, 2.5e-4);
  rest_at(0.0);
}

void AxisPlant::rest_at(double position, double time) noexcept {
  time_ = time;
  position_ = position;
  played_ = position;
  bristle_from_ = position;
  velocity_ = swing_ = swing_speed_ = current_ = current_mean_ = 0.0;
  bristle_.fill(0.0);
  for (auto& [term, memory] : remembering_) memory.start(term->curve, position);
  remembered_at_ = time;
  commands_past_.clear();
  positions_past_.clear();
  positions_past_.push(time, position, 0.0);
}

void AxisPlant::go_on_from(double position, double velocity) noexcept {
  played_ += position - position_;
  bristle_from_ = position_ = position;
  velocity_ = velocity;
  for (auto& [term, memory] : remembering_) memory.go_on_from(position);
  remembered_at_ = time_;
  if (!(age_ > 0.0)) return;
  positions_past_.clear();
  const double shown = play_ != nullptr ? played_ : position_;
  positions_past_.push(time_ - age_, shown - age_ * velocity, velocity);
  positions_past_.push(time_, shown, velocity);
}

double AxisPlant::variable(int code, const AxisPoint& at) const noexcept {
  switch (code) {
    case Variable::velocity:
      return at.velocity;
    case Variable::time:
      return at.time;
    case Variable::current:
      return at.current;
    case Variable::temperature:
      return at.temperature;
    default:
      return at.position;
  }
}

double AxisPlant::motor_besides(const AxisPoint& at) const noexcept {
  double motor = 1.0;
  for (const auto& effect : motors_) motor += effect.function(at, effect.parameters);
  for (const auto& [term, code] : motor_curves_) motor += term->curve(variable(code, at));
  return motor;
}

double AxisPlant::with_terms(double force, const AxisPoint& at) const noexcept {
  for (const auto& effect : forces_) force += effect.function(at, effect.parameters);
  for (const auto& [term, code] : force_curves_) force += term->curve(variable(code, at));
  for (const auto& [term, code] : damping_curves_) force -= term->curve(variable(code, at)) * at.velocity;
  for (std::size_t i = 0; i < bristles_.size(); ++i) {
    const auto* p = bristles_[i]->parameters.data();
    force -= PreslidingFriction::force(
        PreslidingFriction::deflection(bristle_[i], at.position - bristle_from_, p), at.velocity, p);
  }
  for (const auto& [term, memory] : remembering_)
    force += memory.value(term->curve, at.position, at.time - remembered_at_);
  return force;
}

inline double AxisPlant::pushed(const AxisPoint& at) const noexcept {
  double force = parameters_.motor_constant * at.current;
  if (has_motor_terms_) force *= motor_besides(at);
  force = force - parameters_.viscous_damping * at.velocity + outside_force_;
  return has_force_terms_ ? with_terms(force, at) : force;
}

inline double AxisPlant::held(const AxisPoint& at, double speed) const noexcept {
  double friction = 0.0;
  for (const auto& effect : frictions_) friction += effect.function(speed, effect.parameters);
  if (friction_curves_.empty()) return friction;
  for (const auto& [term, code] : friction_curves_) friction += term->curve(variable(code, at));
  return std::max(0.0, friction);  // what is less here than elsewhere pushes nothing
}

double AxisPlant::push(const AxisPoint& at) const noexcept { return pushed(at); }
double AxisPlant::hold(const AxisPoint& at, double speed) const noexcept { return held(at, speed); }

inline double AxisPlant::per_mass(const AxisPoint& at) const noexcept {
  if (mass_curves_.empty()) return per_carriage_mass_;
  double mass = parameters_.mass;
  for (const auto& [term, code] : mass_curves_) mass += term->curve(variable(code, at));
  constexpr double least = 0.05;  // of the carriage stays, whatever is taken off
  // What comes and goes lies on the carriage; the part that swings keeps its mass.
  return 1.0 / (std::max(mass, least * parameters_.mass) - parameters_.mass * mode_.share);
}

inline AxisPlant::Slope AxisPlant::slope(const State& s, double time, double direction,
                                         bool stuck) const noexcept {
  const AxisPoint at{time, s.position, s.velocity, current_mean_, temperature_};
  double force = pushed(at);
  if (direction != 0.0) force -= direction * held(at, std::abs(s.velocity));
  const double spring =
      mode_.stiffness * s.swing + mode_.damping * s.swing_speed;  // pulls the carriage along
  const double carriage = stuck ? 0.0 : (force + spring) * per_mass(at);
  return {s.velocity, carriage, s.swing_speed, -spring * per_swinging_mass_ - carriage};
}

/// The same step, number for number, of a carriage on which nothing swings: that is nearly always, and half the work.
AxisPlant::State AxisPlant::advanced(const State& s, double h, double direction, bool stuck) const noexcept {
  if (mode_.share > 0.0) return advanced_with_mode(s, h, direction, stuck);
  const auto acceleration = [&](double position, double velocity, double time) {
    if (stuck) return 0.0;
    const AxisPoint at{time, position, velocity, current_mean_, temperature_};
    double force = pushed(at);
    if (direction != 0.0) force -= direction * held(at, std::abs(velocity));
    return force * per_mass(at);
  };
  const double half = 0.5 * h, middle = time_ + half;
  const double a = acceleration(s.position, s.velocity, time_);
  const double vb = s.velocity + half * a;
  const double b = acceleration(s.position + half * s.velocity, vb, middle);
  const double vc = s.velocity + half * b;
  const double c = acceleration(s.position + half * vb, vc, middle);
  const double vd = s.velocity + h * c;
  const double d = acceleration(s.position + h * vc, vd, time_ + h);
  return {s.position + h * ((s.velocity + 2.0 * (vb + vc) + vd) * sixth),
          s.velocity + h * ((a + 2.0 * (b + c) + d) * sixth), s.swing, s.swing_speed};
}

AxisPlant::State AxisPlant::advanced_with_mode(const State& s, double h, double direction,
                                               bool stuck) const noexcept {
  const auto moved = [&](const Slope& d, double by) {
    return State{s.position + by * d.velocity, s.velocity + by * d.acceleration, s.swing + by * d.swing_speed,
                 s.swing_speed + by * d.swing_acceleration};
  };
  const auto a = slope(s, time_, direction, stuck);
  const auto b = slope(moved(a, 0.5 * h), time_ + 0.5 * h, direction, stuck);
  const auto c = slope(moved(b, 0.5 * h), time_ + 0.5 * h, direction, stuck);
  const auto d = slope(moved(c, h), time_ + h, direction, stuck);
  const auto mean = [](double p, double q, double r, double w) { return (p + 2.0 * (q + r) + w) * sixth; };
  return moved({mean(a.velocity, b.velocity, c.velocity, d.velocity),
                mean(a.acceleration, b.acceleration, c.acceleration, d.acceleration),
                mean(a.swing_speed, b.swing_speed, c.swing_speed, d.swing_speed),
                mean(a.swing_acceleration, b.swing_acceleration, c.swing_acceleration, d.swing_acceleration)},
               h);
}

void AxisPlant::follow(double position) noexcept {
  position_ = position;
  for (std::size_t i = 0; i < bristles_.size(); ++i)
    bristle_[i] = PreslidingFriction::deflection(bristle_[i], position_ - bristle_from_,
                                                 bristles_[i]->parameters.data());
  bristle_from_ = position_;
  for (auto& [term, memory] : remembering_) memory.advance(term->curve, position_, time_ - remembered_at_);
  remembered_at_ = time_;
}

void AxisPlant::move(double h) noexcept {
  const bool dry = !frictions_.empty() || !friction_curves_.empty();
  // A sub-step may hold a reversal or two; what is left after eight events is done in one go.
  for (int events = 0; h > 0.0 && events < 8; ++events) {
    const State now{position_, velocity_, swing_, swing_speed_};
    double direction = 0.0;
    bool stuck = false;
    if (dry) {
      direction = velocity_ > 0.0 ? 1.0 : (velocity_ < 0.0 ? -1.0 : 0.0);
      if (direction == 0.0) {
        const AxisPoint at{time_, position_, 0.0, current_mean_, temperature_};
        double force = push(at);
        if (mode_.share > 0.0) force += mode_.stiffness * swing_ + mode_.damping * swing_speed_;
        stuck = std::abs(force) <= hold(at, 0.0);
        if (!stuck) direction = force > 0.0 ? 1.0 : -1.0;
      }
    }
    double taken = h;
    State next = advanced(now, h, direction, stuck);
    if (direction != 0.0 && next.velocity * direction < 0.0) {
      if (now.velocity == 0.0) {  // would slide back at once: it stays where it is
        next = advanced(now, h, 0.0, true);
        next.velocity = 0.0;
      } else {
        // The reversal: where the speed passes zero (regula falsi; the speed is nearly straight in time).
        double low = 0.0, low_speed = now.velocity, high = h, high_speed = next.velocity;
        for (int i = 0; i < 4; ++i) {
          taken = low + (high - low) * low_speed / (low_speed - high_speed);
          next = advanced(now, taken, direction, false);
          if (next.velocity * direction > 0.0)
            low = taken, low_speed = next.velocity;
          else
            high = taken, high_speed = next.velocity;
          if (std::abs(next.velocity) <= 1e-12 + 1e-6 * std::abs(now.velocity)) break;
        }
        next.velocity = 0.0;
      }
    }
    if (stuck) next.velocity = 0.0;
    time_ += taken;
    velocity_ = next.velocity, swing_ = next.swing, swing_speed_ = next.swing_speed;
    follow(next.position);
    h -= taken;
  }
  if (h > 0.0) time_ += h;
  if (play_ != nullptr) played_ = Backlash::play(played_, position_, play_->parameters.data());
}

void AxisPlant::drive(double command, double dt) noexcept {
  if (!(dt > 0.0)) return;
  const auto parts = static_cast<int>(std::ceil(dt / longest_substep_ - 1e-9));
  const double h = dt / std::max(1, parts);
  for (int i = 0; i < std::max(1, parts); ++i) {
    if (lag_ > 0.0) {
      // Exact for a held command: the end value, and the mean that the carriage feels over the sub-step.
      const double kept = std::exp(-h / lag_);
      current_mean_ = command + (current_ - command) * lag_ / h * (1.0 - kept);
      current_ = command + (current_ - command) * kept;
    } else {
      current_ = current_mean_ = command;
    }
    move(h);
  }
}

double AxisPlant::commanded(double command, double dt) const noexcept {
  for (const auto* term : commands_)
    command = term->kind->command(command, time_, dt, term->parameters.data());
  for (const auto& [term, code] : command_curves_)
    command += term->curve(code == Variable::current ? command : time_);
  return command;
}

double AxisPlant::applied(double command, double dt) const noexcept {
  if (lag_ > 0.0) return current_;
  if (!(delay_ > 0.0)) return commanded(command, dt);
  const auto& past = commands_past_;
  const std::size_t oldest = past.count - std::min(past.count, Past::size);
  for (std::size_t i = past.count; i > oldest; --i)
    if (past.time[(i - 1) % Past::size] + delay_ <= time_) return past.value[(i - 1) % Past::size];
  return 0.0;
}

void AxisPlant::step(double command, double dt) noexcept {
  command = commanded(command, dt);
  const double begin = time_, end = time_ + dt;
  if (delay_ > 0.0) {
    commands_past_.push(begin, command, 0.0);
    // The commands that reach the motor during this step, oldest first; before the very first one there was
    // none.
    const auto& past = commands_past_;
    const std::size_t oldest = past.count - std::min(past.count, Past::size);
    std::size_t i = past.count - 1;
    while (i > oldest && past.time[i % Past::size] + delay_ > begin) --i;
    double from = begin;
    if (const double first = std::min(end, past.time[i % Past::size] + delay_); first > from) {
      drive(0.0, first - from);
      from = first;
    }
    for (; i < past.count && from < end; ++i) {
      const double until = i + 1 < past.count ? past.time[(i + 1) % Past::size] + delay_ : end;
      const double to = std::min(until, end);
      if (to <= from) continue;
      drive(past.value[i % Past::size], to - from);
      from = to;
    }
  } else {
    drive(command, dt);
  }
  time_ = end;
  if (age_ > 0.0) positions_past_.push(end, play_ != nullptr ? played_ : position_, velocity_);
}

double AxisPlant::delayed_position(double age) const noexcept {
  const double when = time_ - age;
  const auto& past = positions_past_;
  const std::size_t kept = std::min(past.count, Past::size);
  const std::size_t oldest = past.count - kept;
  std::size_t after = past.count - 1;  // the newest instant that is not before `when`
  while (after > oldest && past.time[(after - 1) % Past::size] >= when) --after;
  if (after == oldest) return past.value[oldest % Past::size];
  const auto a = (after - 1) % Past::size, b = after % Past::size;
  const double h = past.time[b] - past.time[a];
  if (!(h > 0.0)) return past.value[b];
  // Cubic Hermite between the two instants.
  const double s = (when - past.time[a]) / h, r = 1.0 - s;
  return past.value[a] * (1.0 + 2.0 * s) * r * r + past.slope[a] * h * s * r * r +
         past.value[b] * s * s * (3.0 - 2.0 * s) - past.slope[b] * h * s * s * r;
}

double AxisPlant::reading() const noexcept {
  double shown = play_ != nullptr ? played_ : position_;
  if (age_ > 0.0) shown = delayed_position(age_);
  return shown + reading_error(shown);
}

double AxisPlant::reading_error(double position) const noexcept {
  double error = 0.0;
  for (const auto& effect : readings_) error += effect.function(position, effect.parameters);
  if (reading_curves_.empty()) return error;
  const AxisPoint at{time_, position, velocity_, current_, temperature_};
  for (const auto& [term, code] : reading_curves_) error += term->curve(variable(code, at));
  return error;
}

}  // namespace invar::physics
