// LineErrors: how far displacement readings are from the way commanded; for lines measured before and after.
#pragma once

#include <string>
#include <vector>

#include "core/metrology/geometric/geometric_model.hpp"

namespace invar::metrology {

/// Rows in the order of measurement: the line's name, where it was commanded [m] and what the instrument read along the
/// beam [m]. A new name begins a new line, whose first row is its start. All of one length.
struct LineReadings {
  std::vector<std::string> line;
  std::vector<double> x, y, z;
  std::vector<double> displacement;
};

struct LineErrors {
  struct Line {
    std::string name;
    std::vector<double> way;    // m, from the line's start
    std::vector<double> error;  // m, reading minus way
  };
  std::vector<Line> lines;
  double rms = 0.0;      // m, over all readings; 0 where there is none
  double maximum = 0.0;  // m, the largest size
};

LineErrors line_errors(const LineReadings& readings);

/// Errors that would be left had the model's error been corrected: each less the model's displacement along the beam, which
/// goes from a line's first point to its farthest.
LineErrors line_errors(const LineReadings& readings, const GeometricModel& model);

}  // namespace invar::metrology
