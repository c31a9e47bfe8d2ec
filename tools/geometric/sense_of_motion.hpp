// The sense of the motion that led to each reading, where no column tells it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace invar::tools {

/// +1 or -1 for each position along the way, in the order of measurement; of a reading at the place of the last one, the sense
/// that follows. A way back in one step over more than half of the range, much longer than the steps, is a return without
/// readings. The reading at its end begins the next pass and has that one's sense.
inline std::vector<int> senses_of_motion(const std::vector<double>& way) {
  constexpr double still = 1e-7;  // m or rad
  constexpr double much = 1.5;    // times the median step
  std::vector<int> senses(way.size(), 1);
  if (way.empty()) return senses;
  std::vector<double> sizes;
  for (std::size_t i = 1; i < way.size(); ++i)
    if (const double size = std::abs(way[i] - way[i - 1]); size > still) sizes.push_back(size);
  double longest = 0.0;
  if (!sizes.empty()) {
    const auto [low, high] = std::minmax_element(way.begin(), way.end());
    const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
    std::nth_element(sizes.begin(), middle, sizes.end());
    longest = std::max(0.5 * (*high - *low), much * *middle);
  }
  int after = 1;
  for (std::size_t i = way.size(); i-- > 0;) {
    const double step = i > 0 ? way[i] - way[i - 1] : 0.0;
    if (std::abs(step) > still && std::abs(step) <= longest) after = step > 0.0 ? 1 : -1;
    senses[i] = after;
  }
  return senses;
}

}  // namespace invar::tools
