#include "core/metrology/geometric/error_motion_networks.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "core/base/index.hpp"

namespace invar::metrology {

namespace {

double square(double value) noexcept { return value * value; }

}  // namespace

double ErrorMotionNetwork::value(double position, std::span<const double> of_machine) const {
  Eigen::VectorXd input(1 + static_cast<Eigen::Index>(states.size()));
  input[0] = position;
  for (std::size_t i = 0; i < states.size(); ++i)
    input[1 + static_cast<Eigen::Index>(i)] = of_machine[states[i]];
  return network(input);
}

double ErrorMotionNetwork::sigma_at(double position, std::span<const double> of_machine) const noexcept {
  const auto outside = [&](std::size_t input, double x) {
    return square((x - network.range[input].clamp(x)) /
                  network.input_scale[static_cast<Eigen::Index>(input)]);
  };
  double distance = outside(0, position);
  for (std::size_t i = 0; i < states.size(); ++i) distance += outside(1 + i, of_machine[states[i]]);
  return std::sqrt(square(sigma) + square(slope) * distance);
}

ErrorMotions ErrorMotionNetworks::motions(const Eigen::Vector3d& position,
                                          std::span<const double> state) const {
  ErrorMotions result;
  for (int c = 0; c < error_motion_count; ++c) {
    const auto& component = components[index(c)];
    if (!component || !chain.has(axis_of(c))) continue;
    ErrorMotion& motion = result[index(axis_of(c))];
    (is_rotation(c) ? motion.rotation : motion.translation)[direction_of(c)] =
        component->value(position[axis_of(c)], state);
  }
  return result;
}

Eigen::Vector3d ErrorMotionNetworks::error(const Eigen::Vector3d& position,
                                           const Eigen::Vector3d& tool_offset,
                                           std::span<const double> state) const {
  Eigen::Vector3d held = position;
  for (int k = 0; k < 3; ++k) held[k] = chain.has(k) ? travel[index(k)].clamp(position[k]) : 0.0;
  return linear_error(chain, axis_directions(chain, squareness), held, motions(held, state), tool_offset);
}

Eigen::Vector3d ErrorMotionNetworks::sigma_at(const Eigen::Vector3d& position,
                                              const Eigen::Vector3d& tool_offset,
                                              std::span<const double> state) const noexcept {
  const Eigen::Matrix3d directions = axis_directions(chain, squareness);
  const Eigen::Matrix3d arms = lever_arms(chain, directions, position, tool_offset);
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();
  for (int c = 0; c < error_motion_count; ++c) {
    const auto& component = components[index(c)];
    if (!component || !chain.has(axis_of(c))) continue;
    const Eigen::Vector3d along = Eigen::Vector3d::Unit(direction_of(c));
    const Eigen::Vector3d effect =
        is_rotation(c) ? Eigen::Vector3d{along.cross(arms.col(axis_of(c)))} : along;
    variance += square(component->sigma_at(position[axis_of(c)], state)) * effect.cwiseAbs2();
  }
  for (int pair = 0; pair < squareness_count; ++pair) {
    if (squareness_sigma[index(pair)] <= 0.0) continue;
    Squareness other = squareness;
    other[index(pair)] += squareness_sigma[index(pair)];
    variance += ((axis_directions(chain, other) - directions) * position).cwiseAbs2();
  }
  return variance.cwiseSqrt();
}

bool ErrorMotionNetworks::knows(std::span<const double> state) const noexcept {
  for (std::size_t i = 0; i < states.size(); ++i)
    if (!states[i].range.contains(state[i])) return false;
  return true;
}

}  // namespace invar::metrology
