// ForceBalance: the force that acts on an axis and that its model does not know, from what the axis does; and where it lies.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "core/physics/axis_feedforward.hpp"

namespace invar::physics {

/// One cycle of an axis, measured.
struct AxisCycle {
  double position = 0.0;  // [m]
  double current = 0.0;   // [A] commanded in this cycle
};

/// A stretch of motion: the force that is missing in the model, and the means of what it may depend on.
struct MissingForce {
  double force = 0.0;  // [N]
  double sigma = 0.0;  // [N] 1 sigma of it where model and machine agree
  double position = 0.0, velocity = 0.0, acceleration = 0.0;
  // [N] that the model needs for this motion. The measured current answers to the missing force, whatever that depends on.
  double motor_force = 0.0;
};

/// The missing force: the change of momentum over a stretch of motion less the impulse of all known forces, over its
/// duration. No second derivative of a reading is taken. Stretches with standstill or reversal in them tell nothing, since
/// dry friction at rest may be anything. A difference within the model's own sigmas counts as agreement. Real-time.
class ForceBalance {
 public:
  struct Settings {
    double stretch = 0.025;  // [s]
    double slowest = 2e-3;   // [m/s] slower is no motion
    double noise = 0.1;      // [N] 1 sigma of what is left over a stretch where all parameters are right
  };
  ForceBalance() : ForceBalance{Model{}, {}} {}
  /// Set-up. Preconditions: the model is of plant axis, stretch and noise are positive.
  ForceBalance(const Model& model, const Settings& settings);

  /// Forgets what came before: cycles are missing, or nothing drives the axis.
  void reset() noexcept { count_ = in_stretch_ = 0; }
  /// One cycle of `period` [s]. True when it ended a stretch; then `missing` says what was found.
  bool add(const AxisCycle& cycle, double period) noexcept;
  [[nodiscard]] const MissingForce& missing() const noexcept { return missing_; }

 private:
  static constexpr std::size_t reach = 4;  // cycles on each side of the one whose velocity is taken
  static constexpr std::size_t kept = 256;
  [[nodiscard]] const AxisCycle& back(std::size_t age) const noexcept {
    return past_[(count_ - 1 - age) % kept];
  }

  AxisFeedforward model_;
  double mass_, motor_constant_, mass_sigma_, motor_sigma_, damping_sigma_;
  Settings settings_;
  std::array<AxisCycle, kept> past_{};
  std::size_t count_ = 0, in_stretch_ = 0;
  double begin_velocity_ = 0.0, direction_ = 0.0;
  MissingForce sum_, missing_;  // the sum of motor_force is one of currents
};

/// Site and variable of a missing force; `site` and `depends_on` as `invar diagnose` names them.
struct Whereabouts {
  std::string_view site, depends_on;
  double share = 0.0;     // of the missing force's square that goes with it
  double strength = 0.0;  // [N] RMS, or per unit: see `unit`
  std::string_view unit;
  std::string_view rival_site, rival;  // what these stretches cannot tell from it; empty: nothing
};

/// The last stretches of motion, and what their missing force depends on: each candidate alone, by the squares that it
/// leaves, priced by its numbers (BIC). Real-time; no allocation.
class MissingForceHistory {
 public:
  static constexpr std::size_t size = 512;
  void clear() noexcept { count_ = 0; }
  void add(const MissingForce& one) noexcept { kept_[count_++ % size] = one; }
  [[nodiscard]] std::size_t count() const noexcept { return count_ < size ? count_ : size; }
  /// Over the newest `newest` stretches.
  [[nodiscard]] double rms(std::size_t newest) const noexcept;
  /// ... of force over sigma.
  [[nodiscard]] double rms_over_sigma(std::size_t newest) const noexcept;
  [[nodiscard]] Whereabouts locate(std::size_t newest) const noexcept;

 private:
  [[nodiscard]] const MissingForce& back(std::size_t age) const noexcept {
    return kept_[(count_ - 1 - age) % size];
  }
  std::array<MissingForce, size> kept_{};
  std::size_t count_ = 0;
};

}  // namespace invar::physics
