// Range: the closed interval in which a number is allowed.
#pragma once

#include <limits>

namespace invar {

struct Range {
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();

  /// False for NaN.
  [[nodiscard]] constexpr bool contains(double value) const { return value >= lower && value <= upper; }
  [[nodiscard]] constexpr double clamp(double value) const {
    return value < lower ? lower : (value > upper ? upper : value);
  }
  [[nodiscard]] constexpr double width() const { return upper - lower; }

  static constexpr Range positive() {
    return {std::numeric_limits<double>::min(), std::numeric_limits<double>::infinity()};
  }
  static constexpr Range not_negative() { return {0.0, std::numeric_limits<double>::infinity()}; }
};

}  // namespace invar
