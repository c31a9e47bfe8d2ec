// Actions of a term on an instrument's reading.
#pragma once

#include "core/physics/term.hpp"

namespace invar::physics {

/// One sample of the quantity that an instrument measures.
struct SensorPoint {
  double position = 0.0;  // [m]
  double velocity = 0.0;  // [m/s]
  double value = 0.0;     // what the ideal instrument would show: position or gain x velocity
};

struct SensorTermKind {
  const TermInfo* info = nullptr;
  double (*reading)(const SensorPoint&, const double*) = nullptr;  // added to the value
  bool delays = false;                                             // by parameter 0 [s]
  bool plays = false;                                              // hysteresis of width parameter 0
};

}  // namespace invar::physics
