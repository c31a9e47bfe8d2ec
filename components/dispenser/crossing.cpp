#include "components/dispenser/crossing.hpp"

#include <cmath>

namespace invar::dispenser {

std::optional<Crossing> crossing(const Motion& motion, const Eigen::Vector2d& aim, double lead) noexcept {
  const double speed = motion.velocity.norm();
  if (!(speed > 1e-9)) return {};
  const Eigen::Vector2d along = motion.velocity / speed;
  const double acceleration = along.dot(motion.acceleration);
  // along . (position(t) + lead velocity(t) - aim) = c + b t + a t^2, rising at its passage through zero.
  const double c = along.dot(motion.position + lead * motion.velocity - aim);
  const double b = speed + lead * acceleration;
  const double a = 0.5 * acceleration;
  const double discriminant = b * b - 4.0 * a * c;
  if (!(b > 0.0) || discriminant < 0.0) return {};
  const double time = -2.0 * c / (b + std::sqrt(discriminant));
  const Eigen::Vector2d rest = motion.position_at(time) + lead * motion.velocity_at(time) - aim;
  return Crossing{time, std::abs(along.x() * rest.y() - along.y() * rest.x())};
}

}  // namespace invar::dispenser
