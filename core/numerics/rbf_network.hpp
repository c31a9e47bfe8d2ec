// RbfNetwork: a Gaussian radial basis function network from D inputs to one output, with its scales and
// ranges.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/base/range.hpp"

namespace invar::numerics {

/// f(x) = offset + scale * (constant + slope . u + sum_k w_k exp(-|(u - c_k) / s_k|^2 / 2)),
/// u_d = (clamp(x_d, range_d) - input_offset_d) / input_scale_d.
///
/// The scales travel with the weights, because a width of 0.05 means 0.05 mm, 10 mm or 50 mm depending on the
/// unit of the input. Outside its range an input is held at the end value: a bare Gaussian would decay to the
/// constant there, and a slope would run away. Source: thesis (2.11), chapter 2.3.
struct RbfNetwork {
  std::vector<Range> range;      // D, in input units: where the network was trained
  Eigen::VectorXd input_offset;  // D, input units
  Eigen::VectorXd input_scale;   // D, input units
  double output_offset = 0.0;    // output units
  double output_scale = 1.0;     // output units
  Eigen::MatrixXd centres;       // D x M, scaled
  Eigen::MatrixXd widths;        // D x M, scaled
  Eigen::VectorXd weights;       // M, scaled
  double constant = 0.0;         // scaled
  Eigen::VectorXd slope;         // D, scaled; zero where there is none

  [[nodiscard]] Eigen::Index inputs() const { return input_offset.size(); }
  [[nodiscard]] Eigen::Index size() const { return weights.size(); }

  /// Inputs held to the range, then scaled.
  [[nodiscard]] Eigen::VectorXd scaled(const Eigen::Ref<const Eigen::VectorXd>& x) const;
  /// The M activations at a scaled point.
  [[nodiscard]] Eigen::VectorXd activations(const Eigen::Ref<const Eigen::VectorXd>& u) const;
  /// In output units. `x` has D entries in input units.
  [[nodiscard]] double operator()(const Eigen::Ref<const Eigen::VectorXd>& x) const;
  [[nodiscard]] double operator()(double x) const;  // D = 1
  /// How far x lies outside the range, in input scales; zero inside.
  [[nodiscard]] double distance_outside(const Eigen::Ref<const Eigen::VectorXd>& x) const;
  /// A bound on |d2 f / dx_d2| anywhere, in output units per input unit squared, from
  /// max |z^2 - 1| exp(-z^2/2) = 1: sum |w_k| / s_k^2. Decides the step of a compiled table.
  [[nodiscard]] double curvature_bound(Eigen::Index d) const;
};

/// Centres on a uniform grid over the ranges, `counts[d]` a dimension (first dimension fastest): D x product.
Eigen::MatrixXd uniform_centres(const std::vector<Range>& ranges, const std::vector<int>& counts);

}  // namespace invar::numerics
