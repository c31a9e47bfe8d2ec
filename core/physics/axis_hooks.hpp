// Actions of a term on an axis: on its force, its motor, its command, its friction, its reading, or its state.
#pragma once

#include "core/physics/term.hpp"

namespace invar::physics {

/// The instant at which a term of an axis is evaluated. SI; temperature in degC.
struct AxisPoint {
  double time = 0.0;
  double position = 0.0;
  double velocity = 0.0;
  double current = 0.0;  // through the motor
  double temperature = 0.0;
};

/// Terms that carry a state of their own; AxisPlant holds that state.
enum class AxisMemory {
  none,
  presliding,
  transport_delay,
  amplifier_lag,
  backlash,
  measurement_delay,
  flexible_mode
};

/// One term of the axis. Each function takes the term's parameters in the order of `info`; those a term does
/// not have are null. Real-time.
struct AxisTermKind {
  const TermInfo* info = nullptr;
  double (*force)(const AxisPoint&, const double*) = nullptr;  // [N] on the carriage, towards +x
  double (*motor)(const AxisPoint&, const double*) = nullptr;  // [1] change of the motor's force, relative
  /// [A] what the motor gets of it, in the mean over the `step` [s] from `time` [s] on.
  double (*command)(double current, double time, double step, const double*) = nullptr;
  double (*friction)(double speed,
                     const double*) = nullptr;  // [N] against the motion; at 0 what breaks it away
  double (*reading)(double position, const double*) = nullptr;  // [m] added to what the encoder shows
  AxisMemory memory = AxisMemory::none;
};

}  // namespace invar::physics
