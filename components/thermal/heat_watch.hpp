// HeatWatch: whether the slide warms as the heat that it was given demands.
#pragma once

#include <optional>

#include "core/base/range.hpp"
#include "core/base/time.hpp"

namespace invar::thermal {

/// Balances the heat given [J] against the warming read [K], through power below full, link drops and changes of setpoint.
/// There are three doubts. Heat beyond the need of holding has not warmed the reading by `rise`. The reading is bit for bit the
/// same while as much heat was given as `rise` needs at the most. The reading leapt as no slide does. The first two come before
/// the heat exceeds that of full power for `within`, counted from the last proof that the thermistor follows. Real-time.
class HeatWatch {
 public:
  struct Settings {
    double full = 0.0;    // highest power [W]
    double rise = 0.5;    // by which full power warms the slide [K] ...
    double within = 120;  // ... at the latest after this [s]
    double hold = 0.5;    // the largest share of full power that holding a temperature may take
    double leap = 5.0;    // more than this between two readings a second apart is no warming [K]
    double lets_go = 0;   // how long a device that is not reached goes on heating [s]
  };
  enum class Doubt { none, unanswered, frozen, leapt };

  void reset() noexcept { *this = {}; }
  /// Once a step: what was read (nothing: no answer), and the time. False: the reading leapt and must not be used yet.
  [[nodiscard]] bool trusts(const Settings& settings, std::optional<double> reading, Instant now) noexcept;
  /// Once a step, after `trusts`: the power given over the coming period, and what was asked for.
  [[nodiscard]] Doubt look(const Settings& settings, std::optional<double> reading, double setpoint,
                           double power, Instant now, double period) noexcept;
  /// The state that goes on in another process: the heat that was given so far.
  template <class W>
  void warm(W& w) noexcept {
    constexpr Range any{-1e12, 1e12};
    w(known_, "watch.known");
    w(lowest_, "watch.lowest", any);
    w(last_, "watch.last", any);
    w(power_then_, "watch.power_then", any);
    w(unanswered_, "watch.unanswered", any);
    w(silent_, "watch.silent", any);
    w(waited_, "watch.waited", any);
    w(last_power_, "watch.last_power", any);
    if (w.loads()) looked_at_.reset();
  }
  /// Since the thermistor last proved to follow [s].
  [[nodiscard]] double waited() const noexcept { return waited_; }

 private:
  void read(const Settings& settings, double reading, double power) noexcept;

  bool known_ = false;
  double lowest_ = 0.0;      // reading since the heat was last answered [degC]
  double last_ = 0.0;        // reading [degC]
  double power_then_ = 0.0;  // when the reading last changed [W]
  double unanswered_ = 0.0;  // heat beyond holding that did not warm the reading [J]
  double silent_ = 0.0;      // heat since the reading last changed [J]
  double waited_ = 0.0;
  double last_power_ = 0.0;          // that a device was reached with [W]
  double unreached_ = 0.0;           // [s]
  std::optional<Instant> begun_at_;  // of the first reading
  std::optional<Instant> looked_at_, trusted_at_, leapt_at_;
  double trusted_ = 0.0;  // reading [degC]
};

}  // namespace invar::thermal
