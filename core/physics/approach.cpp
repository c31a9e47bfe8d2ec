#include "core/physics/approach.hpp"

#include <algorithm>
#include <cmath>

namespace invar::physics {

std::vector<double> directions_of_approach(const std::vector<double>& positions) {
  std::vector<double> directions(positions.size(), 0.0);
  if (positions.empty()) return directions;
  const auto [low, high] = std::minmax_element(positions.begin(), positions.end());
  const double jitter = 1e-3 * (*high - *low);
  double direction = 0.0, farthest = positions.front();
  std::size_t reached = 0;  // the row of the farthest point
  for (std::size_t i = 1; i < positions.size(); ++i) {
    const double moved = positions[i] - farthest;
    if (std::abs(moved) > jitter) {
      const bool turns = moved * direction < 0.0;
      direction = moved > 0.0 ? 1.0 : -1.0;
      if (turns && i == reached + 2) directions[i - 1] = direction;
    }
    if (std::abs(moved) > jitter || moved * direction > 0.0) {
      farthest = positions[i];
      if (std::abs(moved) > jitter) reached = i;
    }
    directions[i] = direction;
  }
  return directions;
}

}  // namespace invar::physics
