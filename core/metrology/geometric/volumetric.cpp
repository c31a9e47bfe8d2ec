#include "core/metrology/geometric/volumetric.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace invar::metrology {

namespace {

/// Rodrigues' formula; for tiny angles the series, so that nothing divides by zero.
Eigen::Matrix3d rotation_matrix(const Eigen::Vector3d& vector) noexcept {
  const double angle2 = vector.squaredNorm();
  const double angle = std::sqrt(angle2);
  const double a = angle < 1e-4 ? 1.0 - angle2 / 6.0 : std::sin(angle) / angle;
  const double b = angle < 1e-4 ? 0.5 - angle2 / 24.0 : (1.0 - std::cos(angle)) / angle2;
  Eigen::Matrix3d cross;
  cross << 0.0, -vector.z(), vector.y(), vector.z(), 0.0, -vector.x(), -vector.y(), vector.x(), 0.0;
  return Eigen::Matrix3d::Identity() + a * cross + b * cross * cross;
}

int axis_at(const Chain& chain, int place) noexcept { return chain.order[static_cast<std::size_t>(place)]; }

}  // namespace

Eigen::Matrix3d axis_directions(const Chain& chain, const Squareness& squareness) noexcept {
  Eigen::Matrix3d directions = Eigen::Matrix3d::Identity();
  for (int place = 1; place < chain.axes; ++place) {
    const int axis = axis_at(chain, place);
    double rest = 1.0;
    for (int before = 0; before < place; ++before) {
      const int towards = axis_at(chain, before);
      const double lean = squareness[static_cast<std::size_t>(squareness_of(axis, towards))];
      directions(towards, axis) = lean;
      rest -= lean * lean;
    }
    directions(axis, axis) = std::sqrt(rest);
  }
  return directions;
}

Eigen::Vector3d exact_error(const Chain& chain, const Eigen::Matrix3d& directions,
                            const Eigen::Vector3d& position, const ErrorMotions& motions,
                            const Eigen::Vector3d& tool) noexcept {
  Eigen::Vector3d actual = Eigen::Vector3d::Zero();
  Eigen::Vector3d nominal = tool;
  Eigen::Matrix3d turned = Eigen::Matrix3d::Identity();
  for (int place = 0; place < chain.axes; ++place) {
    const int axis = axis_at(chain, place);
    const ErrorMotion& motion = motions[static_cast<std::size_t>(axis)];
    actual += turned * (position[axis] * directions.col(axis) + motion.translation);
    turned = turned * rotation_matrix(motion.rotation);
    nominal[axis] += position[axis];
  }
  return actual + turned * tool - nominal;
}

Eigen::Matrix3d lever_arms(const Chain& chain, const Eigen::Matrix3d& directions,
                           const Eigen::Vector3d& position, const Eigen::Vector3d& tool) noexcept {
  Eigen::Matrix3d arms = Eigen::Matrix3d::Zero();
  Eigen::Vector3d arm = tool;
  for (int place = chain.axes - 1; place >= 0; --place) {
    const int axis = axis_at(chain, place);
    arms.col(axis) = arm;
    arm += position[axis] * directions.col(axis);
  }
  return arms;
}

Eigen::Vector3d linear_error(const Chain& chain, const Eigen::Matrix3d& directions,
                             const Eigen::Vector3d& position, const ErrorMotions& motions,
                             const Eigen::Vector3d& tool) noexcept {
  Eigen::Vector3d error = Eigen::Vector3d::Zero();
  Eigen::Vector3d arm = tool;
  for (int place = chain.axes - 1; place >= 0; --place) {
    const int axis = axis_at(chain, place);
    const ErrorMotion& motion = motions[static_cast<std::size_t>(axis)];
    const Eigen::Vector3d along = position[axis] * directions.col(axis);
    error += motion.translation + along + motion.rotation.cross(arm);
    error[axis] -= position[axis];
    arm += along;
  }
  return error;
}

double longest_arm(const Chain& chain, const std::array<Range, 3>& travel, const Eigen::Matrix3d& directions,
                   const Eigen::Vector3d& tool, int axis) {
  double longest = 0.0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      if (chain.has(k)) {
        const Range& range = travel[static_cast<std::size_t>(k)];
        position[k] = ((corner >> static_cast<unsigned>(k)) & 1U) != 0U ? range.upper : range.lower;
      }
    longest = std::max(longest, lever_arms(chain, directions, position, tool).col(axis).norm());
  }
  return longest;
}

}  // namespace invar::metrology
