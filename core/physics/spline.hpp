// CubicSpline: a smooth curve through given points.
#pragma once

#include <vector>

namespace invar::physics {

/// Through all points, not-a-knot ends where there are at least four, and straight on with the end slope outside.
/// Precondition: as many ordinates as ascending abscissae, at least one.
class CubicSpline {
 public:
  CubicSpline(std::vector<double> x, std::vector<double> y);
  [[nodiscard]] double operator()(double x) const;

 private:
  std::vector<double> x_, y_, second_;  // second derivatives at the points
};

}  // namespace invar::physics
