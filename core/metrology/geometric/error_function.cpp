#include "core/metrology/geometric/error_function.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "core/base/contract.hpp"

namespace invar::metrology {

ErrorFunction::ErrorFunction(std::vector<double> polynomial, std::vector<Harmonic> harmonics,
                             std::vector<double> table_positions, std::vector<double> table_values)
    : polynomial_{std::move(polynomial)},
      harmonics_{std::move(harmonics)},
      positions_{std::move(table_positions)},
      values_{std::move(table_values)} {
  const std::size_t n = positions_.size();
  INVAR_EXPECTS(values_.size() == n && n != 1, n, values_.size());
  INVAR_EXPECTS(std::is_sorted(positions_.begin(), positions_.end()));
  for (const Harmonic& harmonic : harmonics_) INVAR_EXPECTS(harmonic.period > 0.0, harmonic.period);
  slopes_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t before = i == 0 ? 0 : i - 1;
    const std::size_t after = std::min(i + 1, n - 1);
    slopes_[i] = (values_[after] - values_[before]) / (positions_[after] - positions_[before]);
  }
}

double ErrorFunction::operator()(double q) const noexcept {
  double sum = 0.0;
  for (std::size_t k = polynomial_.size(); k-- > 0;) sum = sum * q + polynomial_[k];
  for (const Harmonic& h : harmonics_)
    sum += h.amplitude * std::sin(2.0 * std::numbers::pi * q / h.period + h.phase);
  if (positions_.empty()) return sum;
  if (q <= positions_.front()) return sum + values_.front();
  if (q >= positions_.back()) return sum + values_.back();
  const auto next = std::upper_bound(positions_.begin(), positions_.end(), q);
  const auto i = static_cast<std::size_t>(next - positions_.begin()) - 1;
  const double width = positions_[i + 1] - positions_[i];
  const double t = (q - positions_[i]) / width;
  const double s = 1.0 - t;
  return sum + s * s * (1.0 + 2.0 * t) * values_[i] + t * t * (3.0 - 2.0 * t) * values_[i + 1] +
         width * s * t * (s * slopes_[i] - t * slopes_[i + 1]);
}

}  // namespace invar::metrology
