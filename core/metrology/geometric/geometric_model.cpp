#include "core/metrology/geometric/geometric_model.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/index.hpp"

namespace invar::metrology {

Eigen::Vector3d SigmaGrid::at(const Eigen::Vector3d& position) const noexcept {
  std::array<int, 3> low{};
  std::array<double, 3> part{};
  for (std::size_t k = 0; k < 3; ++k) {
    if (count[k] < 2) continue;
    const double u =
        (range[k].clamp(position[static_cast<int>(k)]) - range[k].lower) / range[k].width() * (count[k] - 1);
    low[k] = std::min(static_cast<int>(u), count[k] - 2);
    part[k] = u - low[k];
  }
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();
  for (unsigned corner = 0; corner < 8; ++corner) {
    double weight = 1.0;
    std::array<int, 3> node = low;
    for (unsigned k = 0; k < 3; ++k) {
      const bool upper = ((corner >> k) & 1U) != 0U;
      weight *= upper ? part[k] : 1.0 - part[k];
      node[k] += upper && count[k] > 1 ? 1 : 0;
    }
    if (weight <= 0.0) continue;
    const Eigen::Vector3d& s = values[index((node[2] * count[1] + node[1]) * count[0] + node[0])];
    variance += weight * s.cwiseProduct(s);
  }
  return variance.cwiseSqrt();
}

double GeometricModel::error_motion(int c, double q) const noexcept {
  if (coefficients[index(c)].size() == 0) return 0.0;
  return splines[index(axis_of(c))].value(coefficients[index(c)], q);
}

double GeometricModel::error_motion_sigma(int c, double q) const noexcept {
  const Eigen::VectorXd& values = sigma[index(c)];
  if (values.size() == 0) return std::numeric_limits<double>::infinity();
  const auto& spline = splines[index(axis_of(c))];
  const double u = (spline.interval().clamp(q) - spline.interval().lower) / spline.spacing();
  const int low = std::min(static_cast<int>(u), static_cast<int>(values.size()) - 2);
  return values[low] + (u - low) * (values[low + 1] - values[low]);
}

ErrorMotions GeometricModel::motions(const Eigen::Vector3d& position) const noexcept {
  ErrorMotions result;
  for (int c = 0; c < error_motion_count; ++c) {
    ErrorMotion& motion = result[index(axis_of(c))];
    (is_rotation(c) ? motion.rotation : motion.translation)[direction_of(c)] =
        error_motion(c, position[axis_of(c)]);
  }
  return result;
}

Eigen::Vector3d GeometricModel::error(const Eigen::Vector3d& position,
                                      const Eigen::Vector3d& tool_offset) const noexcept {
  Eigen::Vector3d held = position;
  for (int k = 0; k < 3; ++k) held[k] = chain.has(k) ? travel[index(k)].clamp(position[k]) : 0.0;
  return linear_error(chain, axis_directions(chain, squareness), held, motions(held), tool_offset);
}

Eigen::Vector3d GeometricModel::sigma_at(const Eigen::Vector3d& position,
                                         const Eigen::Vector3d& tool_offset) const noexcept {
  Eigen::Vector3d result = field_sigma.at(position);
  const Eigen::Vector3d longer = tool_offset - tool;
  if (longer.norm() < 1e-6) return result;
  result = result.cwiseProduct(result);
  for (int c = 0; c < error_motion_count; ++c) {
    if (!is_rotation(c) || !chain.has(axis_of(c))) continue;
    const Eigen::Vector3d effect = Eigen::Vector3d::Unit(direction_of(c)).cross(longer);
    const double s = error_motion_sigma(c, position[axis_of(c)]);
    for (int k = 0; k < 3; ++k)
      if (effect[k] != 0.0) result[k] += effect[k] * effect[k] * s * s;
  }
  return result.cwiseSqrt();
}

Eigen::Vector3d GeometricModel::reversal_at(const Eigen::Vector3d& position,
                                            const Eigen::Vector3d& moving) const noexcept {
  return metrology::reversal_at(reversal, position, moving);
}

Eigen::Vector3d GeometricModel::reversal_sigma_at(const Eigen::Vector3d& position,
                                                  const Eigen::Vector3d& moving) const noexcept {
  return metrology::reversal_sigma_at(reversal, position, moving);
}

Eigen::Vector3d GeometricModel::expansion_at(const Eigen::Vector3d& position,
                                             double temperature) const noexcept {
  Eigen::Vector3d result = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3 && reference_temperature; ++k)
    if (chain.has(k))
      result[k] =
          expansion[index(k)] * (temperature - *reference_temperature) * travel[index(k)].clamp(position[k]);
  return result;
}

Eigen::Vector3d GeometricModel::expansion_sigma_at(const Eigen::Vector3d& position,
                                                   double temperature) const noexcept {
  Eigen::Vector3d result = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3 && reference_temperature; ++k) {
    if (!chain.has(k)) continue;
    const Range r = travel[index(k)];
    result[k] = std::abs(expansion_sigma[index(k)] * (temperature - *reference_temperature) *
                         (r.clamp(position[k]) - 0.5 * (r.lower + r.upper)));
  }
  return result;
}

}  // namespace invar::metrology
