// A wave that has no name: a hum over a map or a reading, a ripple of a tachometer.
#pragma once

#include <vector>

#include "core/diagnosis/candidates/start.hpp"
#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// Courses that repeat, at the period that explains most of the fit's residual. They go over time wherever outputs follow row by
/// row, and along the way of a tachometer in proportion to its speed. Knots over a whole recording are too far apart for a wave.
std::vector<Start> wave_starts(const Case& data, const Fit& fitted);

}  // namespace invar::diagnosis
