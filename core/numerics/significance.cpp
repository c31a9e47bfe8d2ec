#include "core/numerics/significance.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace invar::numerics {

namespace {

/// The continued fraction of the incomplete beta function, by Lentz's method.
double beta_fraction(double x, double a, double b) {
  constexpr double tiny = 1e-300;
  const auto bounded = [](double value) { return std::abs(value) < tiny ? tiny : value; };
  double c = 1.0;
  double d = 1.0 / bounded(1.0 - (a + b) * x / (a + 1.0));
  double h = d;
  for (int m = 1; m <= 300; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m));
    d = 1.0 / bounded(1.0 + even * d);
    c = bounded(1.0 + even / c);
    h *= d * c;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0));
    d = 1.0 / bounded(1.0 + odd * d);
    c = bounded(1.0 + odd / c);
    h *= d * c;
    if (std::abs(d * c - 1.0) < 1e-14) break;
  }
  return h;
}

/// The regularised incomplete beta function I_x(a, b).
double incomplete_beta(double x, double a, double b) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  const double front =
      std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x));
  if (x < (a + 1.0) / (a + b + 2.0)) return front * beta_fraction(x, a, b) / a;
  return 1.0 - front * beta_fraction(1.0 - x, b, a) / b;
}

}  // namespace

double f_tail(double f, double numerator, double denominator) {
  if (!(f > 0.0)) return 1.0;
  return incomplete_beta(denominator / (denominator + numerator * f), 0.5 * denominator, 0.5 * numerator);
}

double chance_of_gain(double without, double with, double extra, double freedom) {
  if (!(extra > 0.0) || !(freedom > 0.0) || !(without > with)) return 1.0;
  if (with <= 0.0) return 0.0;
  return f_tail((without - with) / extra / (with / freedom), extra, freedom);
}

double chance_of_alike_neighbours(const std::vector<double>& values) {
  if (values.size() < 10) return 1.0;
  const auto n = static_cast<double>(values.size());
  double mean = 0.0;
  for (const double value : values) mean += value / n;
  double together = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    squares += (values[i] - mean) * (values[i] - mean);
    if (i > 0) together += (values[i] - mean) * (values[i - 1] - mean);
  }
  if (squares <= 0.0) return 1.0;
  // Of independent values the correlation has the mean -1/n and the standard deviation 1/sqrt(n).
  const double z = (together / squares + 1.0 / n) * std::sqrt(n);
  return 0.5 * std::erfc(z / std::numbers::sqrt2);
}

}  // namespace invar::numerics
