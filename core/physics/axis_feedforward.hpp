// AxisFeedforward: the current that a motion needs by the model of its axis, the forces of the model's terms included.
#pragma once

#include <string_view>

#include "core/physics/axis_plant.hpp"
#include "core/physics/model.hpp"

namespace invar::physics {

/// A motion that is wanted.
struct AxisMotion {
  double position = 0.0, velocity = 0.0, acceleration = 0.0;  // SI
};

/// Why a servo cannot feed a term of an axis forward; empty: it can.
std::string_view why_not_fed_forward(const Term& term);

/// For servos: what `invar diagnose` found in a recording is given back as current before it becomes an error. Solves the
/// plant's own force for the current, so every term of a force, a motor, friction or dead zone counts as `simulate` has it.
/// Left out: terms with a `why_not_fed_forward`; a delay or lag of the motor is for the caller to look ahead by `lead`.
/// Evaluation is real-time.
class AxisFeedforward {
 public:
  AxisFeedforward() : AxisFeedforward{Model{}} {}
  /// Set-up. Preconditions: the model is of plant axis.
  explicit AxisFeedforward(const Model& model);

  /// Forgets the way travelled. Real-time.
  void reset(double position) noexcept { plant_.rest_at(position); }
  /// [A], or [V] where the model's motor constant says so; call once a period. At 20 degC unless told.
  [[nodiscard]] double current(const AxisMotion& motion, double temperature = 20.0) noexcept;
  /// All forces on the carriage at a point that the model knows [N], dry friction against `direction` included; the motor's
  /// delay and lag are the caller's. The carriage must have been taken there by `follow`. Real-time.
  [[nodiscard]] double force(const AxisPoint& at, double direction) const noexcept {
    return plant_.force(at, direction);
  }
  void follow(double position) noexcept { plant_.follow(position); }
  /// Excess of the encoder at this reading [m].
  [[nodiscard]] double reading_error(double reading) const noexcept;
  /// By how much earlier the motor wants its current [s]: its delay and lag.
  [[nodiscard]] double lead() const noexcept { return lead_; }

 private:
  AxisPlant plant_;
  double mass_, motor_constant_, lead_ = 0.0, dead_ = 0.0;
};

}  // namespace invar::physics
