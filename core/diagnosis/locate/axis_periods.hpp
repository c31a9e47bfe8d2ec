// Periods: the pitches and frequencies at which a periodic term would explain most of a residual.
#pragma once

#include <utility>
#include <vector>

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// Pitches or frequencies at which a periodic term would explain most, best first (axis: by the adjoint of the loop).
struct Periods {
  std::vector<double> force_pitch, motor_pitch, reading_pitch, force_frequency, mode_frequency;
  std::vector<std::pair<double, double>> squares;  // frequency, and phase at time zero
};
/// The waves along a variable that explain most, up to a hundred, by least squares: sums and weights of a residual in bins over
/// its span. The best four, best first, in its unit.
std::vector<double> long_pitches(const std::vector<double>& sums, const std::vector<double>& weights,
                                 double span);
/// Pitches of a sensor's residual along its position, best first.
std::vector<double> sensor_pitches(const Case& data, const Fit& fitted);
Periods axis_periods(const Case& data, const Weighing& weighing, const Fit& fitted);

}  // namespace invar::diagnosis
