// Thermal distortion of an axis over time, in the form of ISO 230-3. Ranges of the error at places that were read repeatedly,
// in the first hour and over the whole recording.
#pragma once

#include <iosfwd>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/metrology/thermal/thermal_identification.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

/// One place, approached in one direction.
struct DistortionAtPlace {
  double x = 0.0;     // m
  int direction = 0;  // +1, -1; 0 where the recording has none
  std::size_t readings = 0;
  double first_hour =
      0.0;             // m, range of the error in the first 60 min; NaN where the recording does not tell
  double whole = 0.0;  // m, range over the recording
  double end = 0.0;    // m, last less first
  std::vector<double> time, error;  // s from the start, m
};

struct Distortion {
  double duration = 0.0;     // s, of the recording
  double temperature = 0.0;  // K, range of the first thermometer
  double uncertainty = 0.0;  // m, expanded (k = 2), of a range: two readings' noise
  std::vector<DistortionAtPlace>
      places;  // by x; the two farthest apart alone where more were read throughout
  double growth_first_hour =
      0.0;              // m, range of the difference of the two places; NaN where there is one place
  double growth = 0.0;  // m, the same over the recording
};

/// Empty `places` where the recording has no times, or no place was read over four fifths of it. Readings that stand alone
/// as outliers do not count.
Distortion distortion_of(const metrology::ThermalReadings& readings, const metrology::ThermalFit& fit);

nlohmann::json json_of(const Distortion& distortion);
void show(report::Page& page, const Distortion& distortion);
void print(const Distortion& distortion, std::ostream& out);

}  // namespace invar::tools
