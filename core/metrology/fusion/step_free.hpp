// StepFree: takes the step out of an estimate whose sources changed.
#pragma once

#include <cmath>
#include <utility>

#include "core/metrology/fusion/sensor_fusion.hpp"

namespace invar::metrology {

/// For a servo behind a fusion. A sensor that leaves or comes back makes the estimate jump; a jump may also exceed four
/// sigmas of the estimate. The jump is set aside and fades with a time constant, so the servo sees no step. Real-time.
class StepFree {
 public:
  explicit StepFree(double time_constant) : time_constant_{time_constant} {}
  void reset() noexcept {
    started_ = expected_ = false;
    aside_ = 0.0;
  }
  /// The next estimate comes from elsewhere: what it jumps by is set aside, however little.
  void expect_step() noexcept { expected_ = true; }
  /// The position to give out [m].
  double operator()(const FusedPosition& fused, double period) noexcept {
    const double jump = fused.position - (position_ + velocity_ * period);
    const bool broken = std::exchange(expected_, false) || fused.live != live_ ||
                        std::abs(jump) > 4.0 * sigma_;  // false where sigma is unknown
    if (started_ && broken) aside_ -= jump;
    aside_ *= std::exp(-period / time_constant_);
    position_ = fused.position;
    velocity_ = fused.velocity;
    sigma_ = fused.sigma;
    live_ = fused.live;
    started_ = true;
    return fused.position + aside_;
  }

 private:
  double time_constant_;
  double position_ = 0.0, velocity_ = 0.0, sigma_ = 0.0, aside_ = 0.0;
  unsigned live_ = 0;
  bool started_ = false, expected_ = false;
};

}  // namespace invar::metrology
