// Positioning of one rotary axis (ISO 230-1: EAA, EBB, ECC): error over the angle and reversal, from readings.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/base/range.hpp"
#include "core/metrology/geometric/axis_reversal.hpp"
#include "core/metrology/geometric/error_motion_identification.hpp"

namespace invar::metrology {

/// Content of compensation.yaml of kind rotary. Angles in rad.
struct RotaryAxis {
  char letter = 'c';         // 'a', 'b' or 'c'
  Range travel{0.0, 1.0};    // rad, of the readings; one turn exactly where the axis comes round
  bool comes_round = false;  // angles that differ by whole turns are one place
  ErrorMotionNetwork error;  // rad, mean of both directions
  ReversalCurve reversal;    // rad; empty where one direction was read

  /// The place in the travel: whole turns taken off where the axis comes round, held at the ends otherwise.
  [[nodiscard]] double place(double angle) const noexcept;
  /// Actual minus commanded angle. `moving` is +1, -1, or 0 for the mean of both directions.
  [[nodiscard]] double value(double angle, double moving = 0.0) const;
  /// Standard deviation of that; infinity for a direction of an axis that was read in one alone.
  [[nodiscard]] double sigma(double angle, double moving = 0.0) const noexcept;
};

struct RotaryFit {
  RotaryAxis axis;
  ErrorMotionFit fit;  // `kept` and `rest` are of the readings given
};

/// `readings` without states; `direction` empty where every reading has the same. An axis comes round where `travel` is one
/// turn (to a milliradian) and the readings leave no gap above 60 degrees. Needs `least_error_motion_readings`, finite.
RotaryFit identify_rotary(char letter, const ErrorMotionReadings& readings, const Range& travel);

}  // namespace invar::metrology
