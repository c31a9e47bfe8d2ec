// Actions of a term on the position error of an axis.
#pragma once

#include "core/physics/term.hpp"

namespace invar::physics {

/// One point of an error map. SI, temperature differences in K, pressure in hPa.
struct MapPoint {
  double time = 0.0;
  double position = 0.0;
  double direction = 0.0;  // of approach, +1 or -1; 0 where it is not known
  double warmth = 0.0;     // temperature above the reference temperature
  double pressure = 0.0;
  double offset = 0.0;             // lateral, from the scale
  double first = 0.0, last = 1.0;  // ends of the calibrated travel
};

struct ErrorMapTermKind {
  const TermInfo* info = nullptr;
  double (*error)(const MapPoint&, const double*) = nullptr;  // [m] added
  bool delays_warmth = false;  // the scale follows the sensor with parameter 0 [s]
};

}  // namespace invar::physics
