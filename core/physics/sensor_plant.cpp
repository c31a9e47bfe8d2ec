#include "core/physics/sensor_plant.hpp"

#include <algorithm>
#include <utility>

namespace invar::physics {

SensorPlant::SensorPlant(Quantity quantity, std::vector<SensorTerm> terms, double gain)
    : quantity_{quantity}, terms_{std::move(terms)}, gain_{gain} {
  for (const SensorTerm& term : terms_) {
    if (term.kind->delays) delay_ += term.parameters[0];
    if (term.kind->plays) play_ = std::max(play_, 0.0) + term.parameters[0];
  }
  rest_at(0.0);
}

void SensorPlant::rest_at(double position) noexcept {
  points_[0] = {0.0, position, 0.0};
  count_ = 1;
  shown_ = quantity_ == Quantity::position ? position : 0.0;
}

/// Position and velocity some time ago, on the cubic through the steps (velocities as slopes).
SensorPlant::Point SensorPlant::past(double age) const noexcept {
  const Point& now = points_[(count_ - 1) % size];
  const double when = now.time - age;
  const std::size_t kept = std::min(count_, size);
  for (std::size_t back = 1; back < kept; ++back) {
    const Point& b = points_[(count_ - back) % size];
    const Point& a = points_[(count_ - back - 1) % size];
    if (a.time > when) continue;
    const double h = b.time - a.time;
    if (!(h > 0.0)) return b;
    const double s = (when - a.time) / h;
    const double r = 1.0 - s;
    return {when,
            a.position * (1.0 + 2.0 * s) * r * r + a.velocity * h * s * r * r +
                b.position * s * s * (3.0 - 2.0 * s) - b.velocity * h * s * s * r,
            a.velocity * r + b.velocity * s};
  }
  return points_[(count_ - kept) % size];
}

double SensorPlant::step(double position, double velocity, double dt) noexcept {
  const double time = points_[(count_ - 1) % size].time + dt;
  points_[count_ % size] = {time, position, velocity};
  ++count_;
  Point at = delay_ > 0.0 ? past(delay_) : Point{time, position, velocity};
  const bool is_position = quantity_ == Quantity::position;
  double& quantity = is_position ? at.position : at.velocity;
  if (play_ >= 0.0) quantity = shown_ = std::clamp(shown_, quantity - 0.5 * play_, quantity + 0.5 * play_);
  const SensorPoint point{at.position, at.velocity, is_position ? at.position : gain_ * at.velocity};
  double reading = point.value;
  for (const SensorTerm& term : terms_)
    if (term.kind->reading != nullptr) reading += term.kind->reading(point, term.parameters.data());
  return reading;
}

}  // namespace invar::physics
