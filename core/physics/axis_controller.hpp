// AxisController: the discrete PID or cascade that closes an axis's loop, exactly as model.yaml defines it.
#pragma once

#include <optional>

namespace invar::physics {

struct AxisControllerSettings {
  enum class Kind { pid, cascade };
  Kind kind = Kind::pid;
  double rate = 1000.0;  // [Hz]
  double kp = 0.0;       // pid [A/m]; cascade [1/s]
  double ki = 0.0;       // [A/(m s)]
  double kd = 0.0;       // [A s/m]
  double kv = 0.0;       // cascade [A s/m]
  std::optional<double> velocity_filter_hz;
  double limit = 0.0;  // [A], of the output; not positive: none
};

/// pid: e = r - y, `d[k] = d[k-1] + a ((e[k]-e[k-1]) rate - d[k-1])`, `a = 1 - exp(-2 pi f / rate)`,
/// `u = clamp(kp e + ki sum(e)/rate + kd d)`. The sum includes e[k], which is not added where u clamps.
///
/// cascade: `u = clamp(kv (kp e - v))`, v the same filtered backward difference of y. At rest e[-1] = e[0].
///
/// A loop that lost periods is likely to lose more: its current is held for longer, and full gains would make it unstable. After a
/// gap of n periods, 20 at most, the gains are those of the same loop with its time stretched by n. That is kd and kv by 1/n, kp of
/// a pid by 1/n^2, the sum's by 1/n^3, kp of a cascade by 1/n. They are back 10 n periods later. The difference is over all of it.
/// Real-time.
class AxisController {
 public:
  explicit AxisController(const AxisControllerSettings& settings);
  /// Sums and filters at zero; the next step is the first. Real-time.
  void reset() noexcept;
  /// Adds a current to the sum's part of the command, so that somebody else may take it over without a bump; false where
  /// the law has no sum. Real-time.
  bool shift(double current) noexcept;
  /// Shifts so that the next step commands `command` [A] at this error [m]; `periods`: of that step. False as above. Real-time.
  bool go_on_from(double command, double error, double periods = 1.0) noexcept;
  /// The command [A] for this reference and reading [m]; `periods`: since the last step, 1 at least.
  [[nodiscard]] double step(double reference, double reading, double periods = 1.0) noexcept;
  /// That it was made for [Hz].
  [[nodiscard]] double rate() const noexcept { return settings_.rate; }

 private:
  void remember(double periods) noexcept;

  AxisControllerSettings settings_;
  double share_;      // a of the filter
  double gap_ = 1.0;  // n above
  double sum_ = 0.0, last_ = 0.0, rate_of_change_ = 0.0;
  bool started_ = false;
};

}  // namespace invar::physics
