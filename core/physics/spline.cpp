#include "core/physics/spline.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::physics {

CubicSpline::CubicSpline(std::vector<double> x, std::vector<double> y) : x_{std::move(x)}, y_{std::move(y)} {
  INVAR_EXPECTS(!x_.empty() && x_.size() == y_.size(), x_.size(), y_.size());
  const auto n = static_cast<Eigen::Index>(x_.size());
  second_.assign(x_.size(), 0.0);
  if (n < 3) return;
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(n);
  const auto h = [&](Eigen::Index i) {
    return x_[static_cast<std::size_t>(i) + 1] - x_[static_cast<std::size_t>(i)];
  };
  const auto slope = [&](Eigen::Index i) {
    return (y_[static_cast<std::size_t>(i) + 1] - y_[static_cast<std::size_t>(i)]) / h(i);
  };
  for (Eigen::Index i = 1; i + 1 < n; ++i) {
    a(i, i - 1) = h(i - 1), a(i, i) = 2.0 * (h(i - 1) + h(i)), a(i, i + 1) = h(i);
    b(i) = 6.0 * (slope(i) - slope(i - 1));
  }
  if (n == 3) {
    a(0, 0) = a(2, 2) = 1.0;
  } else {  // the third derivative goes on through the second and the last point but one
    a(0, 0) = h(1), a(0, 1) = -(h(0) + h(1)), a(0, 2) = h(0);
    a(n - 1, n - 3) = h(n - 2), a(n - 1, n - 2) = -(h(n - 3) + h(n - 2)), a(n - 1, n - 1) = h(n - 3);
  }
  const Eigen::VectorXd m = numerics::solve_square(a, b);
  for (Eigen::Index i = 0; i < n; ++i) second_[static_cast<std::size_t>(i)] = m(i);
}

double CubicSpline::operator()(double x) const {
  const std::size_t n = x_.size();
  if (n == 1) return y_[0];
  const auto above = std::clamp<std::size_t>(
      static_cast<std::size_t>(std::upper_bound(x_.begin(), x_.end(), x) - x_.begin()), 1, n - 1);
  const std::size_t i = above - 1;
  const double h = x_[i + 1] - x_[i], m0 = second_[i], m1 = second_[i + 1];
  const double inside = std::clamp(x, x_[i], x_[i + 1]);
  const double a = (x_[i + 1] - inside) / h, b = (inside - x_[i]) / h;
  const double value =
      a * y_[i] + b * y_[i + 1] + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * h * h / 6.0;
  if (x == inside) return value;
  const double end_slope =
      (y_[i + 1] - y_[i]) / h + (-(3.0 * a * a - 1.0) * m0 + (3.0 * b * b - 1.0) * m1) * h / 6.0;
  return value + end_slope * (x - inside);
}

}  // namespace invar::physics
