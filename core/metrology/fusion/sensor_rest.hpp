// SensorRest: switches sensors off that add little, and on again when they may matter.
#pragma once

#include <algorithm>
#include <array>

#include "core/metrology/fusion/sensor_fusion.hpp"

namespace invar::metrology {

/// For sensors that cost something to read (thesis, 6.2): a bus, a lamp, a processor. A sensor whose weight stays below
/// `least_weight` for `after` rests. All wake for at least `after` when one stops or starts to be believed, or when the position
/// gets less certain by half. Weights change with speed and noise, so all wake every `look_again` in any case. One believed
/// position sensor and two believed sensors always stay awake. Real-time.
class SensorRest {
 public:
  struct Settings {
    double least_weight = 0.0;  // 0: none ever rests
    double after = 1.0;         // [s]
    double look_again = 10.0;   // [s]
  };
  SensorRest(const Settings& settings, std::size_t positions, std::size_t sensors)
      : settings_{settings}, positions_{positions}, sensors_{sensors} {}

  void reset() noexcept {
    resting_ = 0;
    rested_ = sigma_ = sigma_at_rest_ = 0.0;
    idle_.fill(0.0);
    known_ = false;
  }

  /// The sensors that rest in the next period, as bits.
  unsigned update(const FusedPosition& fused, double period) noexcept {
    if (settings_.least_weight <= 0.0) return 0;
    const bool changed = known_ && fused.live != live_;
    live_ = fused.live;
    known_ = true;
    rested_ += period;
    // Its mean: sigma breathes with every edge of an encoder. Where it is unknown, nothing is ever unsure.
    sigma_ += (fused.sigma - sigma_) * std::min(1.0, period / settings_.after);
    const bool unsure = sigma_ > 1.5 * sigma_at_rest_;
    if (resting_ != 0 && (changed || unsure || rested_ >= settings_.look_again)) {
      resting_ = 0;
      idle_.fill(0.0);
    }
    for (std::size_t i = 0; i < sensors_; ++i) {
      if (is_resting(i)) continue;
      idle_[i] = fused.weights[i] < settings_.least_weight ? idle_[i] + period : 0.0;
      if (idle_[i] < settings_.after || !may_rest(i)) continue;
      if (resting_ == 0) {
        rested_ = 0.0;
        sigma_at_rest_ = sigma_;
      }
      resting_ |= 1U << i;
    }
    return resting_;
  }

 private:
  [[nodiscard]] bool is_resting(std::size_t i) const noexcept { return (resting_ >> i & 1U) != 0U; }
  [[nodiscard]] bool may_rest(std::size_t sensor) const noexcept {
    int awake = 0;
    int places = 0;
    for (std::size_t i = 0; i < sensors_; ++i) {
      if (i == sensor || is_resting(i) || (live_ >> i & 1U) == 0U) continue;
      ++awake;
      if (i < positions_) ++places;
    }
    return places >= 1 && awake >= 2;
  }

  Settings settings_;
  std::size_t positions_, sensors_;
  unsigned resting_ = 0;
  unsigned live_ = 0;
  bool known_ = false;
  double rested_ = 0.0;
  double sigma_ = 0.0, sigma_at_rest_ = 0.0;
  std::array<double, most_sensors> idle_{};
};

}  // namespace invar::metrology
