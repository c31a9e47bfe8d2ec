#include "components/calibration/loop_watch.hpp"

#include <array>
#include <cmath>
#include <cstdio>

namespace invar::calibration {

namespace {

constexpr double most_at_limit = 0.25;     // share of a motion: a loop that can follow has current to spare
constexpr std::int64_t least_clamped = 8;  // samples of one and the same current, which no free one shows
constexpr int least_crossings = 6;         // three periods: a swing, no overshoot

}  // namespace

void LoopWatch::take(const stage::AxisState& state) {
  const std::int64_t at = state.at().time_ns();
  if (at == taken_at_ || !state.enabled() || state.settled()) return;
  taken_at_ = at;
  ++samples_;
  const double current = std::abs(state.current());
  constexpr double same = 1e-9;
  if (current > highest_ * (1.0 + same)) {
    highest_ = current;
    at_highest_ = 0;
  }
  if (current > 0.0 && current >= highest_ * (1.0 - same)) ++at_highest_;
  const double error = state.following_error();
  if (error * last_error_ < 0.0) {
    if (crossings_++ == 0) first_crossing_ = at;
    last_crossing_ = at;
  }
  if (error != 0.0) last_error_ = error;
  largest_error_ = std::max(largest_error_, std::abs(error));
}

double LoopWatch::share_at_limit() const {
  if (at_highest_ < least_clamped) return 0.0;
  return static_cast<double>(at_highest_) / static_cast<double>(samples_);
}

std::string LoopWatch::at_limit() const {
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "current at its limit of %.4g A for %.0f %% of the move", highest_,
                100.0 * share_at_limit());
  return text.data();
}

std::string LoopWatch::swing() const {
  if (crossings_ < least_crossings || last_crossing_ <= first_crossing_) return {};
  const double seconds = static_cast<double>(last_crossing_ - first_crossing_) * 1e-9;
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "the following error swings by up to %.3g um at %.3g Hz",
                1e6 * largest_error_, 0.5 * (crossings_ - 1) / seconds);
  return text.data();
}

std::optional<std::string> LoopWatch::fault() const {
  if (share_at_limit() < most_at_limit) return std::nullopt;
  const std::string swings = swing();
  return at_limit() + (swings.empty() ? "" : "; " + swings);
}

std::string LoopWatch::figures() const {
  std::string text;
  if (share_at_limit() > 0.0) text += "; " + at_limit();
  if (const std::string swings = swing(); !swings.empty()) text += "; " + swings;
  return text;
}

std::string axis_name(const std::string& topic, std::int64_t axis) {
  const auto end = topic.rfind('/');
  const auto begin = end == std::string::npos || end == 0 ? std::string::npos : topic.rfind('/', end - 1);
  if (begin == std::string::npos) return std::string{"axis "} + "xyz"[axis];
  return topic.substr(begin + 1, end - begin - 1);
}

}  // namespace invar::calibration
