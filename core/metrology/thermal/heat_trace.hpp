// HeatTrace: what the loop remembers of a temperature: its rate, and the lagged temperature of a body behind it.
#pragma once

#include <cstddef>
#include <vector>

namespace invar::metrology {

/// Temperatures in the order of time, straight in between. `rate` and `lagged` may be asked at any time, so that a model with
/// a lag that is activated late begins where the body behind the sensor really is. All but the constructor is real-time.
class HeatTrace {
 public:
  /// `rate_filter` [s]: time constant of each of the two low-passes behind `rate`; a steady ramp is known after about six of
  /// them. The last `memory` [s] are kept, one point each `spacing` [s]. Allocates.
  explicit HeatTrace(double rate_filter = 20.0, double memory = 7200.0, double spacing = 2.0);

  /// A reading at `time` [s]; one that is not later than the last is left out.
  void add(double time, double temperature) noexcept;
  void forget() noexcept;

  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] double temperature() const noexcept { return temperature_; }
  [[nodiscard]] double rate() const noexcept { return (slow_ - slower_) / rate_filter_; }  // [K/s]
  /// The lagged temperature of time constant `tau` [s], from equilibrium where the memory begins. Some 10 us.
  [[nodiscard]] double lagged(double tau) const noexcept;
  /// How long the memory is [s]: where it began the lagged temperature is not known, exp(-known / tau) of that is left.
  [[nodiscard]] double known() const noexcept;

 private:
  struct Point {
    double time = 0.0;
    double temperature = 0.0;
  };
  double rate_filter_;
  double spacing_;
  std::vector<Point> points_;  // a ring
  std::size_t begin_ = 0;
  std::size_t count_ = 0;
  double time_ = 0.0;
  double temperature_ = 0.0;
  double slow_ = 0.0;
  double slower_ = 0.0;
};

}  // namespace invar::metrology
