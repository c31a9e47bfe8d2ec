// CubicBSpline: a uniform cubic B-spline basis on an interval.
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/base/range.hpp"

namespace invar::numerics {

/// `intervals` equal pieces, intervals + 3 coefficients; twice continuously differentiable. Outside the interval
/// the end value is held. Any thread.
class CubicBSpline {
 public:
  /// The four coefficients that count at one place, from `first` on; the weights sum to one.
  struct Weights {
    int first = 0;
    std::array<double, 4> value{};
  };

  /// Preconditions: interval of positive width, at least one piece.
  CubicBSpline(Range interval, int intervals);
  CubicBSpline() : CubicBSpline{Range{0.0, 1.0}, 1} {}

  [[nodiscard]] int size() const noexcept { return intervals_ + 3; }
  [[nodiscard]] int intervals() const noexcept { return intervals_; }
  [[nodiscard]] Range interval() const noexcept { return interval_; }
  [[nodiscard]] double spacing() const noexcept { return spacing_; }
  /// Where coefficient i acts most: the mean of its inner knots (Greville); a straight line of coefficients at
  /// these places is that straight line.
  [[nodiscard]] double place(int i) const noexcept { return interval_.lower + (i - 1) * spacing_; }

  /// The same curve by twice as many pieces.
  [[nodiscard]] CubicBSpline halved() const { return {interval_, 2 * intervals_}; }
  [[nodiscard]] Eigen::VectorXd halved(const Eigen::VectorXd& coefficients) const;
  [[nodiscard]] Weights at(double x) const noexcept;
  [[nodiscard]] double value(const Eigen::VectorXd& coefficients, double x) const noexcept;
  /// The largest |f''|: f'' is linear between knots, so its largest value stands at a knot.
  [[nodiscard]] double largest_second_derivative(const Eigen::VectorXd& coefficients) const noexcept;

 private:
  Range interval_;
  int intervals_;
  double spacing_;
};

}  // namespace invar::numerics
