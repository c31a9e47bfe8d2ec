#include "core/numerics/bspline.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"

namespace invar::numerics {

CubicBSpline::CubicBSpline(Range interval, int intervals)
    : interval_{interval}, intervals_{intervals}, spacing_{interval.width() / intervals} {
  INVAR_EXPECTS(intervals >= 1 && interval.width() > 0.0, intervals, interval.lower, interval.upper);
}

CubicBSpline::Weights CubicBSpline::at(double x) const noexcept {
  const double u = (interval_.clamp(x) - interval_.lower) / spacing_;
  const int piece = std::min(static_cast<int>(u), intervals_ - 1);
  const double t = u - piece;
  const double s = 1.0 - t;
  Weights w;
  w.first = piece;
  w.value = {s * s * s / 6.0, (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
             (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0, t * t * t / 6.0};
  return w;
}

Eigen::VectorXd CubicBSpline::halved(const Eigen::VectorXd& coefficients) const {
  // The two-scale relation, 1 4 6 4 1 over 8; the outermost coefficient of the finer spline lies on the first knot's left.
  Eigen::VectorXd finer(2 * intervals_ + 3);
  for (Eigen::Index i = 0; i < finer.size(); ++i) {
    const Eigen::Index k = (i + 1) / 2;
    finer[i] = i % 2 == 1 ? (coefficients[k - 1] + 6.0 * coefficients[k] + coefficients[k + 1]) / 8.0
                          : (coefficients[k] + coefficients[k + 1]) / 2.0;
  }
  return finer;
}

double CubicBSpline::value(const Eigen::VectorXd& coefficients, double x) const noexcept {
  const Weights w = at(x);
  double sum = 0.0;
  for (int i = 0; i < 4; ++i) sum += w.value[static_cast<std::size_t>(i)] * coefficients[w.first + i];
  return sum;
}

double CubicBSpline::largest_second_derivative(const Eigen::VectorXd& coefficients) const noexcept {
  double largest = 0.0;
  for (int i = 0; i + 2 < size(); ++i)
    largest = std::max(largest, std::abs(coefficients[i] - 2.0 * coefficients[i + 1] + coefficients[i + 2]));
  return largest / (spacing_ * spacing_);
}

}  // namespace invar::numerics
