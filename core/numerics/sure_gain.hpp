// Whether one of two ways is better by more than chance, from what both gave on the same runs.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace invar::numerics {

/// True where the mean of than[i] - errors[i] exceeds `times` its standard error. The errors are of the same run or part of
/// one: squared errors, or their logarithms where a few large ones must not decide.
/// False for fewer than three pairs, which tell nothing of chance. The pairs' differences must be independent: parts of
/// a run longer than its errors are correlated.
inline bool surely_less(const std::vector<double>& errors, const std::vector<double>& than,
                        double times = 1.0) {
  const std::size_t pairs = than.size();
  if (pairs < 3 || errors.size() != pairs) return false;
  const auto n = static_cast<double>(pairs);
  double mean = 0.0;
  for (std::size_t i = 0; i < pairs; ++i) mean += (than[i] - errors[i]) / n;
  double variance = 0.0;
  for (std::size_t i = 0; i < pairs; ++i) variance += std::pow(than[i] - errors[i] - mean, 2) / (n - 1.0);
  return mean > times * std::sqrt(variance / n);
}

}  // namespace invar::numerics
