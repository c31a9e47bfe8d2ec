#include "core/metrology/fusion/sensor_fusion.hpp"

#include <algorithm>
#include <cmath>

namespace invar::metrology {

double VelocitySensorModel::response(double v) const noexcept {
  const double size = std::abs(v);
  const double at = std::min(size, fastest);
  double sum = at * (gains[0] + at * (gains[1] + at * (gains[2] + at * gains[3])));
  if (size > fastest) sum += (size - fastest) * sensitivity(fastest);
  return v < 0.0 ? -sum : sum;
}

double VelocitySensorModel::sensitivity(double v) const noexcept {
  const double at = std::min(std::abs(v), fastest);
  return gains[0] + at * (2.0 * gains[1] + at * (3.0 * gains[2] + at * 4.0 * gains[3]));
}

}  // namespace invar::metrology
