#include "components/stage/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace invar::stage {

namespace {

MotionPoint advanced(const MotionPoint& from, double jerk, double t) noexcept {
  return {from.position + t * (from.velocity + t * (from.acceleration / 2 + t * jerk / 6)),
          from.velocity + t * (from.acceleration + t * jerk / 2), from.acceleration + t * jerk};
}

/// How to change the velocity by `change` >= 0: `ramp` s of full jerk, `hold` s of constant acceleration,
/// `ramp` s back.
struct VelocityChange {
  double ramp = 0.0;
  double hold = 0.0;
  [[nodiscard]] double duration() const noexcept { return 2 * ramp + hold; }
};

VelocityChange velocity_change(double change, const MotionLimits& limits) noexcept {
  const double full = limits.acceleration / limits.jerk;
  if (change >= limits.acceleration * full) return {full, change / limits.acceleration - full};
  return {std::sqrt(change / limits.jerk), 0.0};
}

/// The highest velocity on a way of `distance` that is too short for the limit: 2 * (v * T(v) / 2) =
/// distance.
double peak_velocity(double distance, const MotionLimits& limits) noexcept {
  const double full = limits.acceleration / limits.jerk;
  const double with_hold =
      limits.acceleration / 2 * (std::sqrt(full * full + 4 * distance / limits.acceleration) - full);
  if (with_hold >= limits.acceleration * full) return with_hold;
  return std::cbrt(distance * distance * limits.jerk / 4);
}

}  // namespace

void Trajectory::append(double duration, double jerk) noexcept {
  if (duration <= 0.0 || count_ == pieces_.size()) return;
  pieces_[count_++] = {duration_, jerk, end_};
  end_ = advanced(end_, jerk, duration);
  duration_ += duration;
}

Trajectory Trajectory::rest(double position) noexcept {
  Trajectory result;
  result.end_ = {position, 0.0, 0.0};
  return result;
}

Trajectory Trajectory::move(double from, double to, const MotionLimits& limits) noexcept {
  Trajectory result = rest(from);
  const double distance = std::abs(to - from);
  const double sign = to < from ? -1.0 : 1.0;
  if (distance == 0.0) return result;
  double velocity = limits.velocity;
  double cruise = 0.0;
  if (const double needed = velocity * velocity_change(velocity, limits).duration(); distance >= needed) {
    cruise = (distance - needed) / velocity;
  } else {
    velocity = peak_velocity(distance, limits);
  }
  const VelocityChange change = velocity_change(velocity, limits);
  const double jerk = sign * limits.jerk;
  result.append(change.ramp, jerk);
  result.append(change.hold, 0.0);
  result.append(change.ramp, -jerk);
  result.append(cruise, 0.0);
  result.append(change.ramp, -jerk);
  result.append(change.hold, 0.0);
  result.append(change.ramp, jerk);
  result.end_ = {to, 0.0, 0.0};  // exactly, whatever rounding did
  return result;
}

Trajectory Trajectory::stop(const MotionPoint& from, const MotionLimits& limits) noexcept {
  Trajectory result;
  result.end_ = from;
  // Where the velocity would go if the acceleration only faded; that way the braking has to push.
  const double fading = from.velocity + from.acceleration * std::abs(from.acceleration) / (2 * limits.jerk);
  const double sign = fading < 0.0 ? -1.0 : 1.0;
  const double velocity = sign * from.velocity;
  const double acceleration = sign * from.acceleration;
  // From `acceleration` down to -peak, held there, and back to 0: the velocity falls by all it has.
  double peak = std::sqrt(std::max(0.0, acceleration * acceleration / 2 + limits.jerk * velocity));
  double hold = 0.0;
  if (peak > limits.acceleration) {
    peak = limits.acceleration;
    hold = (velocity + (acceleration * acceleration / 2 - peak * peak) / limits.jerk) / peak;
  }
  result.append((acceleration + peak) / limits.jerk, -sign * limits.jerk);
  result.append(hold, 0.0);
  result.append(peak / limits.jerk, sign * limits.jerk);
  result.end_ = {result.end_.position, 0.0, 0.0};
  return result;
}

Trajectory Trajectory::sine(double from, double amplitude, double period, unsigned periods) noexcept {
  Trajectory result = rest(from);
  result.amplitude_ = amplitude;
  result.frequency_ = 2.0 * std::numbers::pi / period;
  result.duration_ = period * periods;
  return result;
}

MotionPoint Trajectory::at(double time) const noexcept {
  const double t = std::max(time, 0.0);
  if (amplitude_ != 0.0 && t < duration_) {
    const double phase = frequency_ * t;
    const double speed = amplitude_ * frequency_;
    return {end_.position + amplitude_ * (1.0 - std::cos(phase)), speed * std::sin(phase),
            speed * frequency_ * std::cos(phase)};
  }
  if (t >= duration_ || count_ == 0) return end_;
  std::size_t i = 0;
  while (i + 1 < count_ && pieces_[i + 1].begin <= t) ++i;
  return advanced(pieces_[i].start, pieces_[i].jerk, t - pieces_[i].begin);
}

}  // namespace invar::stage
