// The error field over the volume: nodes that fill it, its shape less rigid motion, and how surely it is known.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/metrology/geometric/geometric_basis.hpp"

namespace invar::metrology {

/// Nodes [m] that fill the travels: `count` along each axis.
std::vector<Eigen::Vector3d> volume_grid(const Chain& chain, const std::array<Range, 3>& travel, int count);

/// Nodes and weights that average over the travels: Gauss-Legendre, so that they do not fall on the measured points.
struct VolumeNode {
  Eigen::Vector3d position;  // m
  double weight;             // their sum is 1
};
std::vector<VolumeNode> volume_nodes(const Chain& chain, const std::array<Range, 3>& travel);

/// The part of a field that is no rigid motion: e - R a, with R the rigid motions (translations, rotations) that best fit
/// it over `grid`. `map` gives a = map * unknowns; `rigid` the columns of R at a position.
struct RigidPart {
  Eigen::MatrixXd map;
  [[nodiscard]] static Eigen::MatrixXd rigid(const Chain& chain, const Eigen::Vector3d& position);
};
RigidPart rigid_part(const GeometricBasis& basis, const Squareness& squareness,
                     const std::vector<Eigen::Vector3d>& grid, const Eigen::Vector3d& tool);

/// V(P) less the rigid part: 3 x unknowns.
Eigen::MatrixXd shape_map(const GeometricBasis& basis, const Squareness& squareness, const RigidPart& rigid,
                          const Eigen::Vector3d& position, const Eigen::Vector3d& tool);

/// Weight of the field's shape: its trace with a covariance of the unknowns is the mean square of the error vector [m^2]
/// over the travels, rigid motion removed.
Eigen::MatrixXd shape_weight(const GeometricBasis& basis, const Squareness& squareness,
                             const std::array<Range, 3>& travel, const Eigen::Vector3d& tool);

/// Variance of the field's shape at any position, from a covariance of the unknowns. Only few splines count at one place: the
/// covariance is turned into that of the splines' coefficients once, and a position picks its own.
class FieldVariance {
 public:
  FieldVariance(const GeometricBasis& basis, const Squareness& squareness, const RigidPart& rigid,
                const Eigen::MatrixXd& covariance);
  /// m^2, by direction; 0 along an axis that the machine lacks.
  [[nodiscard]] Eigen::Vector3d at(const Eigen::Vector3d& position, const Eigen::Vector3d& tool) const;

 private:
  const GeometricBasis& basis_;
  Squareness squareness_;
  std::vector<Eigen::Index> first_;  // coefficient of each block; then the waves, the squareness
  Eigen::MatrixXd covariance_;       // of the coefficients and the squareness
  Eigen::MatrixXd cross_;            // of the rigid motion with them: 6 x coefficients
  Eigen::MatrixXd rigid_;            // of the rigid motion: 6 x 6
};

}  // namespace invar::metrology
