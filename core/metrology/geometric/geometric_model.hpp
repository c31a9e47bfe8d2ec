// GeometricModel: an identified geometric error: evaluated anywhere, with its standard deviation.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "core/base/range.hpp"
#include "core/metrology/geometric/axis_reversal.hpp"
#include "core/metrology/geometric/volumetric.hpp"
#include "core/numerics/bspline.hpp"

namespace invar::metrology {

/// Standard deviations of the field on a grid over the travels, linear in between (of the variance), held outside.
struct SigmaGrid {
  std::array<Range, 3> range{Range{0, 1}, Range{0, 1}, Range{0, 1}};  // m, by axis letter
  std::array<int, 3> count{1, 1, 1};    // nodes, 1 for an axis the machine lacks
  std::vector<Eigen::Vector3d> values;  // m; x fastest, then y, then z; infinity where nothing is known
  /// Real-time.
  [[nodiscard]] Eigen::Vector3d at(const Eigen::Vector3d& position) const noexcept;
};

/// Content of compensation.yaml of kind geometric.
struct GeometricModel {
  Chain chain;
  std::array<Range, 3> travel{Range{0, 1}, Range{0, 1}, Range{0, 1}};  // m
  Eigen::Vector3d tool = Eigen::Vector3d::Zero();                      // m, of the calibration
  std::array<numerics::CubicBSpline, 3> splines;                       // by axis letter
  std::array<Eigen::VectorXd, error_motion_count>
      coefficients;  // m or rad; of size 0 for an error motion not modelled
  std::array<Eigen::VectorXd, error_motion_count> sigma;  // of the error motion at its splines' knots
  Squareness squareness{};
  Squareness squareness_sigma{};
  /// Lost motion of each axis over its position, half to either side of `error`. Empty where no line along the axis was
  /// measured both ways.
  std::array<ReversalCurve, 3> reversal;
  /// Where temperatures were measured: all else holds at the reference; an axis grows by expansion * (T - reference) * q.
  std::optional<double> reference_temperature;  // degC
  std::array<double, 3> expansion{};            // 1/K, of each axis with its scale
  std::array<double, 3> expansion_sigma{};      // 1/K
  SigmaGrid field_sigma;

  [[nodiscard]] double error_motion(int motion, double q) const noexcept;
  /// Infinity for an error motion that is not modelled.
  [[nodiscard]] double error_motion_sigma(int motion, double q) const noexcept;
  [[nodiscard]] ErrorMotions motions(const Eigen::Vector3d& position) const noexcept;

  /// Actual minus commanded position [m]; end values are held outside the travels. No allocation.
  [[nodiscard]] Eigen::Vector3d error(const Eigen::Vector3d& position,
                                      const Eigen::Vector3d& tool) const noexcept;
  /// Standard deviation [m] of `error`, of the field's shape: less the rigid motion of the frame, which is a
  /// convention. Another tool than the calibration's adds the angles' share as if independent.
  [[nodiscard]] Eigen::Vector3d sigma_at(const Eigen::Vector3d& position,
                                         const Eigen::Vector3d& tool) const noexcept;
  /// Part of `error` that follows the sense of the last motion [m]: `moving` holds +1 or -1 by axis, 0 for the mean of both.
  [[nodiscard]] Eigen::Vector3d reversal_at(const Eigen::Vector3d& position,
                                            const Eigen::Vector3d& moving) const noexcept;
  /// Standard deviation [m] of that.
  [[nodiscard]] Eigen::Vector3d reversal_sigma_at(const Eigen::Vector3d& position,
                                                  const Eigen::Vector3d& moving) const noexcept;
  /// Part of `error` that another temperature [degC] makes [m], and its standard deviation about mid travel; zero without a
  /// reference.
  [[nodiscard]] Eigen::Vector3d expansion_at(const Eigen::Vector3d& position,
                                             double temperature) const noexcept;
  [[nodiscard]] Eigen::Vector3d expansion_sigma_at(const Eigen::Vector3d& position,
                                                   double temperature) const noexcept;
};

}  // namespace invar::metrology
