#include "core/metrology/geometric/volumetric_table.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/base/index.hpp"

namespace invar::metrology {

VolumetricTable::VolumetricTable(const GeometricModel& model, double tolerance, int most_nodes)
    : chain_{model.chain},
      travel_{model.travel},
      directions_{axis_directions(model.chain, model.squareness)},
      tool_{model.tool},
      field_sigma_{model.field_sigma} {
  for (int axis = 0; axis < 3; ++axis) {
    if (!chain_.has(axis)) continue;
    // h^2/8 times the sum of largest curvatures, rotations at their longest arm, bounds this axis' share.
    const double arm = longest_arm(model.chain, model.travel, directions_, model.tool, axis);
    double curvature = 0.0;
    for (int c = 6 * axis; c < 6 * axis + 6; ++c)
      if (model.coefficients[index(c)].size() > 0)
        curvature += (is_rotation(c) ? arm : 1.0) *
                     model.splines[index(axis)].largest_second_derivative(model.coefficients[index(c)]);
    const Range range = travel_[index(axis)];
    const double wanted = std::sqrt(8.0 * tolerance / chain_.axes / std::max(curvature, 1e-12));
    const int pieces = std::clamp(static_cast<int>(std::ceil(range.width() / wanted)), 1, most_nodes - 1);
    const double step = range.width() / pieces;
    bound_ += step * step / 8.0 * curvature;
    inverse_[index(axis)] = pieces / range.width();
    for (int i = 0; i <= pieces; ++i) {
      Node node;
      for (int c = 0; c < 6; ++c)
        node.motion[index(c)] = model.error_motion(6 * axis + c, range.lower + i * step);
      nodes_[index(axis)].push_back(node);
    }
  }
  constexpr int grid = 9;
  for (int i = 0; i < grid * grid * grid && chain_.axes > 0; ++i) {
    const std::array<int, 3> node{i % grid, i / grid % grid, i / (grid * grid)};
    Eigen::Vector3d position;
    for (int k = 0; k < 3; ++k)
      position[k] = travel_[index(k)].lower + travel_[index(k)].width() * node[index(k)] / (grid - 1);
    largest_ = std::max(largest_, error(position).norm());
  }
}

Eigen::Vector3d VolumetricTable::error(const Eigen::Vector3d& position,
                                       const Eigen::Vector3d& tool) const noexcept {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Vector3d arm = tool;
  for (int place = chain_.axes - 1; place >= 0; --place) {
    const int axis = chain_.order[index(place)];
    const auto& nodes = nodes_[index(axis)];
    const double q = travel_[index(axis)].clamp(position[axis]);
    const double u = (q - travel_[index(axis)].lower) * inverse_[index(axis)];
    const std::size_t low = std::min(static_cast<std::size_t>(u), nodes.size() - 2);
    const double part = u - static_cast<double>(low);
    const auto& a = nodes[low].motion;
    const auto& b = nodes[low + 1].motion;
    std::array<double, 6> m;
    for (std::size_t k = 0; k < 6; ++k) m[k] = a[k] + part * (b[k] - a[k]);
    const Eigen::Vector3d along = q * directions_.col(axis);
    sum[0] += m[0] + along[0] + m[4] * arm[2] - m[5] * arm[1];
    sum[1] += m[1] + along[1] + m[5] * arm[0] - m[3] * arm[2];
    sum[2] += m[2] + along[2] + m[3] * arm[1] - m[4] * arm[0];
    sum[axis] -= q;
    arm += along;
  }
  return sum;
}

Eigen::Vector3d VolumetricTable::command_for(const Eigen::Vector3d& wanted,
                                             const Eigen::Vector3d& tool) const noexcept {
  return wanted - error(wanted - error(wanted, tool), tool);
}

bool VolumetricTable::contains(const Eigen::Vector3d& position) const noexcept {
  for (int k = 0; k < 3; ++k)
    if (chain_.has(k) && !travel_[index(k)].contains(position[k])) return false;
  return true;
}

}  // namespace invar::metrology
