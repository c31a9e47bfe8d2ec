// SensorPlant: one instrument on an axis that steps in time: what it shows of a motion through the physics terms it is given.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "core/physics/sensor_hooks.hpp"

namespace invar::physics {

/// A term with its numbers, in the order of its info.
struct SensorTerm {
  const SensorTermKind* kind = nullptr;
  std::array<double, most_parameters> parameters{};
};

/// The truth side of a position or velocity sensor, without noise and resolution. The order of things is that of `simulate`:
/// delay, then play, then gain, then what is added to the reading. The past is a cubic through the steps, so a delay need
/// not be a multiple of the period. Repeatable bit for bit.
class SensorPlant {
 public:
  enum class Quantity { position, velocity };

  /// `gain`: reading per quantity. Set-up only.
  SensorPlant(Quantity quantity, std::vector<SensorTerm> terms, double gain = 1.0);
  /// At rest there since ever. Real-time.
  void rest_at(double position) noexcept;
  /// The reading `dt` [s] after the step before, of a carriage that now is here and this fast. Real-time. A delay beyond
  /// 250 steps shows the oldest that is remembered.
  [[nodiscard]] double step(double position, double velocity, double dt) noexcept;

 private:
  struct Point {
    double time, position, velocity;
  };
  [[nodiscard]] Point past(double age) const noexcept;

  Quantity quantity_;
  std::vector<SensorTerm> terms_;
  double gain_;
  double delay_ = 0.0;
  double play_ = -1.0;  // negative: none
  double shown_ = 0.0;  // behind the play
  static constexpr std::size_t size = 256;
  std::array<Point, size> points_{};  // a ring
  std::size_t count_ = 0;
};

}  // namespace invar::physics
