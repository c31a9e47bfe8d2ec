// AxisFeedforward: the current that a motion needs by the model of its axis, the forces of the model's terms included.
#pragma once

#include "core/physics/axis_plant.hpp"
#include "core/physics/model.hpp"

namespace invar::physics {

/// A motion that is wanted.
struct AxisMotion {
  double position = 0.0, velocity = 0.0, acceleration = 0.0;  // SI
};

/// For servos: what `invar diagnose` found in a recording is given back as current before it becomes an error. Solves the
/// plant's own force for the current, so every term of a force, a motor, friction or dead zone counts as `simulate` has it.
/// Left out: terms that go over time (a recording's clock is not the loop's), swinging parts and backlash; a delay or
/// lag of the motor is for the caller to look ahead by `lead`. Evaluation is real-time.
class AxisFeedforward {
 public:
  AxisFeedforward() : AxisFeedforward{Model{}} {}
  /// Set-up. Preconditions: the model is of plant axis.
  explicit AxisFeedforward(const Model& model);

  /// Forgets the way travelled. Real-time.
  void reset(double position) noexcept { plant_.rest_at(position); }
  /// [A], or [V] where the model's motor constant says so; call once a period. At 20 degC unless told.
  [[nodiscard]] double current(const AxisMotion& motion, double temperature = 20.0) noexcept;
  /// What the encoder shows too much at this reading [m].
  [[nodiscard]] double reading_error(double reading) const noexcept;
  /// By how much earlier the motor wants its current [s]: its delay and lag.
  [[nodiscard]] double lead() const noexcept { return lead_; }

 private:
  AxisPlant plant_;
  double mass_, motor_constant_, lead_ = 0.0, dead_ = 0.0;
};

}  // namespace invar::physics
