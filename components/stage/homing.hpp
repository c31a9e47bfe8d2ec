// Homing: where an axis' zero is - the edge of a switch, an index pulse or a hard stop, each taken twice.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "core/base/range.hpp"
#include "core/base/time.hpp"

namespace invar::stage {

/// Parameters of homing; the methods are those of CiA 402-2 (homing method, object 6098h).
struct HomingParameters {
  std::string method = "home_switch";
  std::string direction = "negative";
  bool index = false;
  double creep = 1e-3;
  double margin = 0.01;
  double tolerance = 5e-5;
  double debounce = 5e-3;
  double current = 0.0;
  double stall_time = 0.05;
  std::optional<double> position;
  void describe(auto& p) {
    p(method, "method",
      "home_switch (CiA 402: 19 to 30), limit_switch (17, 18), index_pulse (33, 34) or hard_stop (-1, -2)");
    p(direction, "direction", "negative or positive: the way to the switch, the pulse or the stop");
    p(index, "index", "zero is the first index pulse off the switch (CiA 402: 1 to 14)");
    p(creep, "creep", "m/s", Range{1e-6, 1.0}, "at which edges, pulses and stops are taken, twice");
    p(margin, "margin", "m", Range{1e-5, 1.0},
      "homing that needs more than `travel` and this ends; a switch must be open over it beside its edge");
    p(tolerance, "tolerance", "m", Range{1e-9, 1e-2}, "by which the two may differ");
    p(debounce, "debounce", "s", Range{0.0, 1.0}, "a switch counts that has not changed for so long");
    p(current, "current", "A", Range{0.0, 1e3}, "against a hard stop at most; 0: a quarter of control.limit");
    p(stall_time, "stall_time", "s", Range{1e-3, 10.0},
      "a hard stop is where the axis stands for so long at this current or beyond `following_error`");
    p(position, "position", "m", Range{-100.0, 100.0},
      "position of the home; none: the end of `travel` on that side");
    if constexpr (requires { p.node(); }) {
      if (method != "home_switch" && method != "limit_switch" && method != "index_pulse" &&
          method != "hard_stop")
        p.node()["method"].fault("`" + method + "` is no way of homing",
                                 "use home_switch, limit_switch, index_pulse or hard_stop");
      if (direction != "negative" && direction != "positive")
        p.node()["direction"].fault("`" + direction + "` is no direction", "use negative or positive");
    }
  }
};

/// Decides, once a period, the next motion of an axis that seeks its home. It finds the switch and leaves it by `margin`, over
/// which the switch must be open (first of all where it is closed at the start). From there it takes the edge twice at
/// `creep`; the two must agree. A limit that closes, a way longer than travel and margin, or a switch, pulse or stop that
/// does not work ends the homing with a reason. Real-time.
class Homing {
 public:
  struct Settings {
    enum class Method { home_switch, limit_switch, index_pulse, hard_stop };
    Method method = Method::home_switch;
    double toward = -1.0;  // direction of the search
    bool index = false;
    double search = 0.01, creep = 1e-3;  // m/s
    double travel = 0.2, margin = 0.01, tolerance = 5e-5;
    Duration debounce = Duration::milliseconds(5), stall = Duration::milliseconds(50);
  };
  static Settings settings(const HomingParameters& parameters, double search_velocity, double travel);

  struct Sensed {
    Instant now;
    double position = 0.0;
    bool home = false, limit_low = false, limit_high = false;
    bool pushes = false;             // at the current, or beyond the following error, of a hard stop
    std::uint64_t pulses = 0;        // seen by the encoder so far
    std::optional<double> pulse_at;  // where the newest was, in the terms of `position`
    bool at_rest = false;            // the last order is carried out
  };
  struct Order {
    enum class Kind { keep, go, brake, halt, done, failed } kind = Kind::keep;
    double way = 0.0;       // go: signed [m]
    double velocity = 0.0;  // go
  };

  [[nodiscard]] Order start(const Settings& settings, const Sensed& sensed) noexcept;
  [[nodiscard]] Order step(const Sensed& sensed) noexcept;
  /// After `done`: what was taken for the home, in the terms of `position`.
  [[nodiscard]] double found() const noexcept { return found_; }
  /// After `failed`.
  [[nodiscard]] const char* reason() const noexcept { return reason_.data(); }
  /// It pushes against a stop on purpose: less current, and no trip by the following error.
  [[nodiscard]] bool presses() const noexcept {
    return settings_.method == Settings::Method::hard_stop && way_ * settings_.toward > 0.0;
  }

 private:
  enum class Phase { leave, search, back, take, index_out, index_return, clear };
  Order enter(Phase phase, const Sensed& sensed) noexcept;
  Order end_leg(Phase next, Order::Kind how = Order::Kind::brake) noexcept;
  Order took(double at, Phase again, Phase after, const char* what, Order::Kind how) noexcept;
  Order finish(const Sensed& sensed) noexcept;
  Order failed(const char* format, ...) noexcept __attribute__((format(printf, 2, 3)));
  Order exhausted(const Sensed& sensed) noexcept;
  Order event(const Sensed& sensed) noexcept;
  void watch_switch(const Sensed& sensed) noexcept;
  [[nodiscard]] bool limit(const Sensed& sensed, double direction) const noexcept {
    return direction < 0.0 ? sensed.limit_low : sensed.limit_high;
  }
  [[nodiscard]] bool raw_switch(const Sensed& sensed) const noexcept;
  [[nodiscard]] const char* switch_name() const noexcept;
  [[nodiscard]] double outward() const noexcept;

  Settings settings_;
  Phase phase_ = Phase::leave, next_ = Phase::leave;
  bool waits_ = false;               // for rest, then next_
  bool finishing_ = false;           // for rest, then done
  bool must_pass_ = false;           // began beyond the switch: leaving ends behind it
  bool was_closed_ = false;          // in this phase
  bool began_closed_ = false;        // ... at its start
  bool left_ = false;                // the switch was seen to be open beside its edge
  std::optional<double> opened_at_;  // where it did, in this phase
  double way_ = 0.0;                 // of this phase [m]
  double began_at_ = 0.0;            // position when the phase began
  std::array<double, 2> taken_{};
  int takes_ = 0;
  std::uint64_t pulses_ = 0;
  bool closed_ = false;             // the switch, debounced
  std::optional<Instant> changes_;  // since when it shows another state ...
  double changes_at_ = 0.0;         // ... and where that began
  double changed_at_ = 0.0;         // where the debounced state began
  std::optional<Instant> stands_;   // pushing, and not moving, since
  double stands_at_ = 0.0;
  double found_ = 0.0;
  std::array<char, 240> reason_{};
};

}  // namespace invar::stage
