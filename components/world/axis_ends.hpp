// AxisEnds: home switch, limit switches, index marks and hard stops of a simulated axis, and how they may fail.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/range.hpp"
#include "core/base/time.hpp"

namespace invar::world {

struct AxisEndsParameters {
  std::string home_end = "low";
  double home_at = 0.0;
  double home_width = 1e3;
  std::string home = "works";
  double bounce = 0.0;
  double limits = 2e-3;
  std::string limit = "works";
  double stops = 5e-3;
  double index_pitch = 0.0;
  double index_at = 0.0;
  bool incremental = false;
  void describe(auto& p) {
    p(home_end, "home_end", "low or high: the end of the travel with the home switch");
    p(home_at, "home_at", "m", Range{-10.0, 10.0}, "where it closes, outwards from that end of the travel");
    p(home_width, "home_width", "m", Range{1e-6, 1e3}, "... and for how long from there");
    p(home, "home", "works, open, closed (stuck), inverted");
    p(bounce, "bounce", "s", Range{0.0, 1.0}, "for so long after it changes the home switch chatters");
    p(limits, "limits", "m", Range{0.0, 1e3}, "how far outside the travel the limit switches close");
    p(limit, "limit", "works, open, closed (stuck)");
    p(stops, "stops", "m", Range{0.0, 1e3}, "how far outside the travel the hard stops are");
    p(index_pitch, "index_pitch", "m", Range{0.0, 10.0}, "from index mark to index mark; 0: there are none");
    p(index_at, "index_at", "m", Range{-10.0, 10.0}, "where one of them is");
    p(incremental, "incremental", "the encoder counts from where the axis stands at the start");
    if constexpr (requires { p.node(); }) {
      const auto check = [&](const char* name, const std::string& value, const std::string& may_be) {
        if ((", " + may_be + ",").find(", " + value + ",") == std::string::npos)
          p.node()[name].fault("`" + value + "` is none of them", "use one of " + may_be);
      };
      check("home_end", home_end, "low, high");
      check("home", home, "works, open, closed, inverted");
      check("limit", limit, "works, open, closed");
    }
  }
};

/// By the true position of the carriage. Real-time.
class AxisEnds {
 public:
  AxisEnds(const AxisEndsParameters& parameters, Range travel);
  void reset(double position) noexcept;
  /// Once a period: where the carriage is now.
  void update(double position, Instant now, std::uint64_t cycle) noexcept;
  [[nodiscard]] Range stops() const noexcept { return stops_; }
  [[nodiscard]] bool home() const noexcept { return home_shown_; }
  [[nodiscard]] bool limit_low() const noexcept;
  [[nodiscard]] bool limit_high() const noexcept;
  [[nodiscard]] bool has_index() const noexcept { return parameters_.index_pitch > 0.0; }
  [[nodiscard]] std::uint64_t pulses() const noexcept { return pulses_; }
  [[nodiscard]] double pulse_at() const noexcept { return pulse_at_; }

 private:
  [[nodiscard]] bool home_closed() const noexcept;

  const AxisEndsParameters& parameters_;
  Range travel_, stops_;
  double position_ = 0.0;
  bool home_ = false, home_shown_ = false;
  std::optional<Instant> chatters_until_;
  std::uint64_t pulses_ = 0;
  double pulse_at_ = 0.0;
};

}  // namespace invar::world
