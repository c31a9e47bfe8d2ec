#include "core/executor/histogram.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace invar {

std::uint64_t HistogramCopy::count() const {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

Duration HistogramCopy::quantile(double fraction) const {
  const std::uint64_t all = count();
  if (all == 0) return {};
  const double rank = std::clamp(fraction, 0.0, 1.0) * static_cast<double>(all);
  double below = 0.0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const auto here = static_cast<double>(counts[i]);
    if (here == 0.0 || below + here < rank) {
      below += here;
      continue;
    }
    const auto lower = static_cast<double>(histogram::lower_edge(i));
    const auto upper = static_cast<double>(histogram::lower_edge(i + 1));
    const auto value = static_cast<std::int64_t>(std::floor(lower + (upper - lower) * (rank - below) / here));
    return {std::min(std::max(value, histogram::lower_edge(i)), max.ns)};
  }
  return max;
}

Percentiles HistogramCopy::percentiles() const {
  return {count(), quantile(0.5), quantile(0.99), quantile(0.999), max};
}

HistogramCopy HistogramCopy::since(const HistogramCopy& earlier) const {
  HistogramCopy out = *this;
  for (std::size_t i = 0; i < counts.size(); ++i) out.counts[i] -= std::min(earlier.counts[i], out.counts[i]);
  return out;
}

void HistogramCopy::add(Duration value) {
  ++counts[histogram::bucket_of(value.ns)];
  max = std::max(max, value);
}

void HistogramCopy::add(const HistogramCopy& other) {
  for (std::size_t i = 0; i < counts.size(); ++i) counts[i] += other.counts[i];
  max = std::max(max, other.max);
}

}  // namespace invar
