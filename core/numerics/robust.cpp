#include "core/numerics/robust.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/contract.hpp"

namespace invar::numerics {

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

double robust_deviation(const std::vector<double>& values, double centre) {
  std::vector<double> apart;
  apart.reserve(values.size());
  for (const double value : values) apart.push_back(std::abs(value - centre));
  return 1.4826 * median(std::move(apart));
}

Normality anderson_darling(std::vector<double> values) {
  INVAR_EXPECTS(values.size() >= 8, values.size());
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  double mean = 0.0;
  for (const double value : values) mean += value / n;
  double variance = 0.0;
  for (const double value : values) variance += (value - mean) * (value - mean) / (n - 1.0);
  Normality result;
  if (variance <= 0.0) return {std::numeric_limits<double>::infinity(), 0.0};
  const double deviation = std::sqrt(variance);
  const auto below = [&](double value) {
    return std::clamp(0.5 * std::erfc(-(value - mean) / (deviation * std::numbers::sqrt2)), 1e-300,
                      1.0 - 1e-16);
  };
  double sum = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i)
    sum += (2.0 * static_cast<double>(i) + 1.0) *
           (std::log(below(values[i])) + std::log1p(-below(values[values.size() - 1 - i])));
  const double a = (-n - sum / n) * (1.0 + 0.75 / n + 2.25 / (n * n));
  result.statistic = a;
  // D'Agostino and Stephens 1986, table 4.9.
  if (a < 0.2)
    result.probability = 1.0 - std::exp(-13.436 + 101.14 * a - 223.73 * a * a);
  else if (a < 0.34)
    result.probability = 1.0 - std::exp(-8.318 + 42.796 * a - 59.938 * a * a);
  else if (a < 0.6)
    result.probability = std::exp(0.9177 - 4.279 * a - 1.38 * a * a);
  else
    result.probability = std::exp(1.2937 - 5.709 * a + 0.0186 * a * a);
  result.probability = a > 13.0 ? 0.0 : std::clamp(result.probability, 0.0, 1.0);
  return result;
}

}  // namespace invar::numerics
