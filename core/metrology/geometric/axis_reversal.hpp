// The lost motion of each axis over its position, from displacement lines read in both directions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/base/range.hpp"
#include "core/metrology/geometric/displacement_line.hpp"
#include "core/metrology/geometric/volumetric.hpp"
#include "core/numerics/bspline.hpp"

namespace invar::metrology {

/// Where an axis stands after moving forward minus after moving backward [m], over its position; ISO 230-2 calls its value
/// at a target the reversal. Empty: no line read the axis in both directions.
struct ReversalCurve {
  numerics::CubicBSpline spline;
  Eigen::VectorXd coefficients;  // m
  Eigen::VectorXd sigma;         // m, at the spline's knots
  [[nodiscard]] bool empty() const noexcept { return coefficients.size() == 0; }
  /// Real-time, as the others; 0 for an empty curve.
  [[nodiscard]] double value(double position) const noexcept;
  [[nodiscard]] double sigma_at(double position) const noexcept;  // infinity for an empty curve
  /// Over the interval.
  [[nodiscard]] double mean() const noexcept;
};

/// Part of the error that follows the sense of each axis' last motion [m]: half its reversal, `moving` +1, -1 or 0 by axis; and the
/// standard deviation of that. Real-time.
Eigen::Vector3d reversal_at(const std::array<ReversalCurve, 3>& reversal, const Eigen::Vector3d& position,
                            const Eigen::Vector3d& moving) noexcept;
Eigen::Vector3d reversal_sigma_at(const std::array<ReversalCurve, 3>& reversal,
                                  const Eigen::Vector3d& position, const Eigen::Vector3d& moving) noexcept;

/// Reversal of one axis from readings of its positioning in both directions, at the places that were read both ways.
ReversalCurve reversal_of_readings(const Eigen::VectorXd& position, const Eigen::VectorXd& value,
                                   const std::vector<int>& direction, Range travel);

/// The same value everywhere.
ReversalCurve constant_reversal(Range travel, double value, double sigma);

/// All lines at once: along a beam with direction d a line shows the sum of |d_k| times the reversal of axis k. Each curve
/// is a constant with waves, whose strength and length the readings decide: both are averaged over, by their evidence.
std::array<ReversalCurve, 3> axis_reversals(const std::vector<CondensedLine>& lines, const Chain& chain,
                                            const std::array<Range, 3>& travel);

}  // namespace invar::metrology
