// When a moving nozzle has to trigger so that the droplet lands on its target.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace invar::dispenser {

/// The nozzle in the plane of the substrate.
struct Motion {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();      // m
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();      // m/s
  Eigen::Vector2d acceleration = Eigen::Vector2d::Zero();  // m/s2

  [[nodiscard]] Eigen::Vector2d position_at(double time) const {
    return position + time * (velocity + 0.5 * time * acceleration);
  }
  [[nodiscard]] Eigen::Vector2d velocity_at(double time) const { return velocity + time * acceleration; }
};

struct Crossing {
  double time = 0.0;    // s after the motion's instant; negative: it was then
  double beside = 0.0;  // m; how far the path leads past the aim
};

/// The time t at which position(t) + lead * velocity(t) passes `aim` along the direction of motion: what is jetted
/// then lands `lead` times its own velocity farther. Constant acceleration; the nearest passage. Nothing where the nozzle
/// stands or turns back before. *Real-time.*
///
/// Worked number: 72 mm/s towards an aim 10 mm ahead, lead 10 ms: t = (0.010 - 0.00072) / 0.072 = 128.889 ms.
[[nodiscard]] std::optional<Crossing> crossing(const Motion& motion, const Eigen::Vector2d& aim,
                                               double lead) noexcept;

}  // namespace invar::dispenser
