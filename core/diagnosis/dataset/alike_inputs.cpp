#include "core/diagnosis/dataset/alike_inputs.hpp"

#include <algorithm>
#include <cmath>

#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

namespace {

/// Pearson's correlation of two signals over the rows of all recordings; 0 where one stands still.
double correlation(const Case& data, const std::string& one, const std::string& other) {
  double x0 = 0.0, y0 = 0.0, n = 0.0, a = 0.0, b = 0.0, aa = 0.0, bb = 0.0, ab = 0.0;
  for (const auto& recording : data.recordings) {
    const auto *x = recording.inputs.find(one), *y = recording.inputs.find(other);
    if (x == nullptr || y == nullptr) return 0.0;
    for (std::size_t i = 0; i < std::min(x->size(), y->size()); ++i) {
      if (!std::isfinite((*x)[i]) || !std::isfinite((*y)[i])) continue;
      if (n == 0.0) x0 = (*x)[i], y0 = (*y)[i];  // values far from zero keep their digits
      const double dx = (*x)[i] - x0, dy = (*y)[i] - y0;
      n += 1.0, a += dx, b += dy, aa += dx * dx, bb += dy * dy, ab += dx * dy;
    }
  }
  const double spread = (n * aa - a * a) * (n * bb - b * b);
  return spread > 0.0 ? (n * ab - a * b) / std::sqrt(spread) : 0.0;
}

}  // namespace

std::size_t inputs_like(const Case& data, const std::string& symbol) {
  const auto& inputs = data.model.equations.inputs;
  const auto own =
      std::find_if(inputs.begin(), inputs.end(), [&](const auto& i) { return i.symbol == symbol; });
  if (own == inputs.end()) return 0;
  return static_cast<std::size_t>(std::count_if(inputs.begin(), inputs.end(), [&](const auto& other) {
    return other.symbol != symbol &&
           std::abs(correlation(data, own->signal, other.signal)) > thresholds::runs_alike;
  }));
}

}  // namespace invar::diagnosis
