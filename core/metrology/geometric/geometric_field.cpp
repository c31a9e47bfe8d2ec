#include "core/metrology/geometric/geometric_field.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/base/index.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

std::vector<Eigen::Vector3d> volume_grid(const Chain& chain, const std::array<Range, 3>& travel, int count) {
  std::vector<Eigen::Vector3d> grid;
  const auto nodes = [&](int axis) { return chain.has(axis) ? count : 1; };
  const auto at = [&](int axis, int i) {
    const Range r = travel[index(axis)];
    return chain.has(axis) ? r.lower + r.width() * i / (count - 1) : 0.0;
  };
  for (int k = 0; k < nodes(2); ++k)
    for (int j = 0; j < nodes(1); ++j)
      for (int i = 0; i < nodes(0); ++i) grid.emplace_back(at(0, i), at(1, j), at(2, k));
  return grid;
}

std::vector<VolumeNode> volume_nodes(const Chain& chain, const std::array<Range, 3>& travel) {
  constexpr std::array<double, 6> place{0.033765243, 0.169395307, 0.380690407,
                                        0.619309593, 0.830604693, 0.966234757};
  constexpr std::array<double, 6> weight{0.085662246, 0.180380787, 0.233956967,
                                         0.233956967, 0.180380787, 0.085662246};
  std::vector<VolumeNode> nodes{{Eigen::Vector3d::Zero(), 1.0}};
  for (int axis = 0; axis < 3; ++axis) {
    if (!chain.has(axis)) continue;
    std::vector<VolumeNode> more;
    for (const VolumeNode& node : nodes) {
      for (std::size_t i = 0; i < place.size(); ++i) {
        VolumeNode one = node;
        one.position[axis] = travel[index(axis)].lower + place[i] * travel[index(axis)].width();
        one.weight *= weight[i];
        more.push_back(one);
      }
    }
    nodes = std::move(more);
  }
  return nodes;
}

Eigen::MatrixXd RigidPart::rigid(const Chain& chain, const Eigen::Vector3d& p) {
  Eigen::MatrixXd modes = Eigen::MatrixXd::Zero(3, 6);
  modes.leftCols<3>().setIdentity();
  modes.col(3) = Eigen::Vector3d{0.0, -p.z(), p.y()};
  modes.col(4) = Eigen::Vector3d{p.z(), 0.0, -p.x()};
  modes.col(5) = Eigen::Vector3d{-p.y(), p.x(), 0.0};
  for (int k = 0; k < 3; ++k) {
    if (chain.has(k)) continue;
    modes.row(k).setZero();  // an axis that is not there: no error along it, no rotation out of the plane
    for (int about = 0; about < 3; ++about)
      if (about != k) modes.col(3 + about).setZero();
  }
  return modes;
}

RigidPart rigid_part(const GeometricBasis& basis, const Squareness& squareness,
                     const std::vector<Eigen::Vector3d>& grid, const Eigen::Vector3d& tool) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(6, basis.size);
  for (const auto& position : grid) {
    const Eigen::MatrixXd modes = RigidPart::rigid(basis.chain, position);
    Eigen::MatrixXd field = field_map(basis, squareness, position, tool);
    for (int k = 0; k < 3; ++k)
      if (!basis.chain.has(k)) field.row(k).setZero();
    normal += modes.transpose() * modes;
    right += modes.transpose() * field;
  }
  return {numerics::shortest_least_squares(normal, right)};
}

Eigen::MatrixXd shape_map(const GeometricBasis& basis, const Squareness& squareness, const RigidPart& rigid,
                          const Eigen::Vector3d& position, const Eigen::Vector3d& tool) {
  return field_map(basis, squareness, position, tool) - RigidPart::rigid(basis.chain, position) * rigid.map;
}

Eigen::MatrixXd shape_weight(const GeometricBasis& basis, const Squareness& squareness,
                             const std::array<Range, 3>& travel, const Eigen::Vector3d& tool) {
  const auto nodes = volume_nodes(basis.chain, travel);
  const RigidPart rigid = rigid_part(basis, squareness, volume_grid(basis.chain, travel, 5), tool);
  Eigen::MatrixXd all(3 * static_cast<Eigen::Index>(nodes.size()), basis.size);
  for (std::size_t g = 0; g < nodes.size(); ++g) {
    Eigen::MatrixXd map = shape_map(basis, squareness, rigid, nodes[g].position, tool);
    for (int k = 0; k < 3; ++k)
      if (!basis.chain.has(k)) map.row(k).setZero();
    all.middleRows<3>(3 * static_cast<Eigen::Index>(g)) = std::sqrt(nodes[g].weight) * map;
  }
  return all.transpose() * all;
}

FieldVariance::FieldVariance(const GeometricBasis& basis, const Squareness& squareness,
                             const RigidPart& rigid, const Eigen::MatrixXd& covariance)
    : basis_{basis}, squareness_{squareness} {
  Eigen::Index size = 0;
  for (const auto& block : basis.blocks) {
    first_.push_back(size);
    size += block.coefficients.rows();
  }
  first_.push_back(size);
  const auto waves = static_cast<Eigen::Index>(basis.first_squareness() - basis.first_wave());
  size += waves;
  first_.push_back(size);
  const auto pairs = static_cast<Eigen::Index>(basis.pairs.size());
  size += pairs;
  // From the left, then from the right.
  const auto expanded = [&](const Eigen::MatrixXd& of_unknowns) {
    Eigen::MatrixXd result(size, of_unknowns.cols());
    for (std::size_t b = 0; b < basis.blocks.size(); ++b) {
      const auto& block = basis.blocks[b];
      result.middleRows(first_[b], block.coefficients.rows()) =
          block.coefficients * of_unknowns.middleRows(block.first, block.size());
    }
    result.middleRows(first_[basis.blocks.size()], waves) = of_unknowns.middleRows(basis.first_wave(), waves);
    result.bottomRows(pairs) = of_unknowns.middleRows(basis.first_squareness(), pairs);
    return result;
  };
  covariance_ = expanded(expanded(covariance).transpose());
  const Eigen::MatrixXd moved = covariance * rigid.map.transpose();
  cross_ = expanded(moved).transpose();
  rigid_ = rigid.map * moved;
}

Eigen::Vector3d FieldVariance::at(const Eigen::Vector3d& position, const Eigen::Vector3d& tool) const {
  const auto terms = field_terms(basis_, squareness_, position, tool);
  const Eigen::MatrixXd square = squareness_map(basis_, squareness_, position);
  const Eigen::MatrixXd modes = RigidPart::rigid(basis_.chain, position);
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();
  std::vector<Eigen::Index> place;
  std::vector<double> weight;
  for (int k = 0; k < 3; ++k) {
    if (!basis_.chain.has(k)) continue;
    place.clear();
    weight.clear();
    for (const FieldTerm& term : terms) {
      if (term.effect[k] == 0.0) continue;
      for (int i = 0; i < 4; ++i) {
        place.push_back(first_[term.block] + term.weights.first + i);
        weight.push_back(term.effect[k] * term.weights.value[index(i)]);
      }
    }
    for (std::size_t i = 0; i < basis_.waves.size(); ++i) {
      if (basis_.waves[i].axis != k) continue;
      const Eigen::RowVector3d row = basis_.wave_row(basis_.waves[i], position[k]);
      for (Eigen::Index u = 0; u < wave_unknowns; ++u) {
        place.push_back(first_[basis_.blocks.size()] + wave_unknowns * static_cast<Eigen::Index>(i) + u);
        weight.push_back(row[u]);
      }
    }
    for (Eigen::Index i = 0; i < square.cols(); ++i) {
      place.push_back(first_.back() + i);
      weight.push_back(square(k, i));
    }
    const Eigen::VectorXd motion = modes.row(k).transpose();
    double sum = motion.dot(rigid_ * motion);
    for (std::size_t i = 0; i < place.size(); ++i) {
      double own = -2.0 * motion.dot(cross_.col(place[i]));
      for (std::size_t j = 0; j < place.size(); ++j) own += weight[j] * covariance_(place[j], place[i]);
      sum += weight[i] * own;
    }
    variance[k] = std::max(sum, 0.0);
  }
  return variance;
}

}  // namespace invar::metrology
