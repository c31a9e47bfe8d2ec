// Actions of a term on a thermal node: heat, air or heater, storage, late reading.
#pragma once

#include "core/physics/term.hpp"

namespace invar::physics {

/// A node at the instant at which a term is evaluated. Temperatures in degC.
struct ThermalPoint {
  double time = 0.0;
  double temperature = 0.0;        // of the node
  double other_temperature = 0.0;  // of the node at the other end, for couplings
  double ambient = 0.0;
  double speed = 0.0;          // [m/s] of the stage
  double motor_current = 0.0;  // [A]
};

enum class ThermalMemory { none, hidden_node, sensor_lag };

/// One term of a thermal plant; functions it does not have are null. Real-time.
struct ThermalTermKind {
  const TermInfo* info = nullptr;
  double (*heat)(const ThermalPoint&, const double*) = nullptr;  // [W] into the node
  double (*ambient)(double time, const double*) = nullptr;       // [K] added to the air
  double (*heater)(double power, const double*) = nullptr;       // [W] what the heater makes of it
  bool couples = false;                                          // `heat` leaves the node at the other end
  ThermalMemory memory = ThermalMemory::none;
};

}  // namespace invar::physics
