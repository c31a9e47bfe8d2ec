// Trajectory: one axis from rest to rest, or from motion to a stop, with bounded velocity, acceleration and
// jerk.
#pragma once

#include <array>
#include <cstddef>

#include "core/base/range.hpp"

namespace invar::stage {

struct MotionLimits {
  double velocity = 0.1;      // m/s
  double acceleration = 2.0;  // m/s2
  double jerk = 50.0;         // m/s3
};

struct MotionPoint {
  double position = 0.0;      // m
  double velocity = 0.0;      // m/s
  double acceleration = 0.0;  // m/s2
};

/// Pieces of constant jerk, evaluated in closed form. Real-time.
class Trajectory {
 public:
  /// Stands at `position`.
  static Trajectory rest(double position) noexcept;
  /// Rest to rest in the least time within the limits: the double-S profile of seven pieces (Biagiotti and
  /// Melchiorri, Trajectory Planning for Automatic Machines and Robots, section 3.4).
  static Trajectory move(double from, double to, const MotionLimits& limits) noexcept;
  /// `periods` times from + amplitude (1 - cos(2 pi t / period)): at rest at both ends, but for a step of the acceleration.
  static Trajectory sine(double from, double amplitude, double period, unsigned periods) noexcept;
  /// From any motion to rest in the least time: a move that is stopped never goes beyond where it was to end.
  static Trajectory stop(const MotionPoint& from, const MotionLimits& limits) noexcept;

  /// The motion `time` [s] after the start; the end point afterwards, the start before.
  [[nodiscard]] MotionPoint at(double time) const noexcept;
  [[nodiscard]] double duration() const noexcept { return duration_; }
  [[nodiscard]] double target() const noexcept { return at(duration_).position; }

  /// The state that goes on in another process. `w(double&, name, Range)`.
  template <class W>
  void warm(W& w) noexcept {
    constexpr Range places{-1e3, 1e3}, speeds{-1e2, 1e2}, accelerations{-1e4, 1e4}, jerks{-1e7, 1e7},
        times{0.0, 1e6};
    const auto point = [&](MotionPoint& p) {
      w(p.position, "trajectory.position", places);
      w(p.velocity, "trajectory.velocity", speeds);
      w(p.acceleration, "trajectory.acceleration", accelerations);
    };
    double count = static_cast<double>(count_);
    w(count, "trajectory.count", Range{0.0, static_cast<double>(pieces_.size())});
    if (w.loads()) count_ = static_cast<std::size_t>(count);
    for (Piece& piece : pieces_) {
      w(piece.begin, "trajectory.begin", times);
      w(piece.jerk, "trajectory.jerk", jerks);
      point(piece.start);
    }
    point(end_);
    w(amplitude_, "trajectory.amplitude", places);
    w(frequency_, "trajectory.frequency", Range{0.0, 1e6});
    w(duration_, "trajectory.duration", times);
  }

 private:
  struct Piece {
    double begin = 0.0;  // s
    double jerk = 0.0;   // m/s3
    MotionPoint start;
  };
  void append(double duration, double jerk) noexcept;

  std::array<Piece, 8> pieces_{};
  std::size_t count_ = 0;
  double amplitude_ = 0.0;  // of a sine
  double frequency_ = 0.0;  // [rad/s]
  double duration_ = 0.0;
  MotionPoint end_;
};

}  // namespace invar::stage
