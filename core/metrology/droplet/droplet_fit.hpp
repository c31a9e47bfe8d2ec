// DropletFit: one robust fit of droplets by a chosen set of numbers, and the tests by which the set is chosen.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/metrology/droplet/droplet_trajectory.hpp"

namespace invar::metrology {

/// Which columns there are beside the placement: slope x, y; the field; delay; slowness (in this order).
struct DropletForm {
  bool tilt = false;
  bool delay = false;
  bool carry = false;
  FieldForm field = FieldForm::none;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // of the field
  [[nodiscard]] Eigen::Index field_begin() const { return tilt ? 4 : 2; }
  [[nodiscard]] Eigen::Index field_columns() const {
    return field == FieldForm::none ? 0 : field == FieldForm::any ? 4 : 2;
  }
  [[nodiscard]] Eigen::Index columns() const {
    return field_begin() + field_columns() + (delay ? 1 : 0) + (carry ? 1 : 0);
  }
  /// The field's columns of both components at `d` from the centre: (scale, rotation), or the matrix row by row.
  [[nodiscard]] Eigen::Matrix<double, 2, Eigen::Dynamic> field_at(const Eigen::Vector2d& d) const {
    Eigen::Matrix<double, 2, Eigen::Dynamic> columns(2, field_columns());
    if (field == FieldForm::rotation_and_scale) columns << d.x(), -d.y(), d.y(), d.x();
    if (field == FieldForm::any) columns << d.x(), d.y(), 0.0, 0.0, 0.0, 0.0, d.x(), d.y();
    return columns;
  }
};

struct DropletSolution {
  Eigen::VectorXd theta;
  Eigen::MatrixXd covariance;  // for unit weights' variance
};

/// The start that every fit of the same droplets shares.
struct DropletStart {
  const Droplets& drops;
  const Eigen::Matrix2Xd& offset;
  const Eigen::VectorXd& sound;         // 0: a satellite by its diameter
  const Eigen::Matrix2Xd& from_median;  // of its height
  const std::vector<int>& group;
  const std::vector<double>& levels;
};

struct DropletFit {
  DropletSolution solution;
  Eigen::VectorXd kept;
  Eigen::VectorXd deviation;  // scatter of one component of each droplet [m]
  Eigen::Matrix2Xd residual;
  double at_nozzle = 0.0;
  double per_height = 0.0;
};

DropletFit fit_robustly(const DropletStart& start, const DropletForm& form);

Eigen::Vector2d centre_of(const Eigen::Matrix2Xd& target, const Eigen::VectorXd& sound);

/// Whether the targets are spread enough to tell a field: over a line a rotation and one scale, in both directions any.
bool spans_field(const Eigen::Matrix2Xd& target, const Eigen::VectorXd& sound, FieldForm field);

/// Probability that chance makes the wider form, fitted as `by`, as much better on the droplets that it keeps.
double chance_of_field(const DropletStart& start, const DropletForm& form, const DropletFit& by,
                       const DropletForm& wider);

/// Whether what is left is scatter: against a field of second order, and against neighbours in the order of printing that
/// deviate alike.
ScatterTest test_scatter(const DropletStart& start, const DropletForm& form, const DropletFit& fit);

}  // namespace invar::metrology
