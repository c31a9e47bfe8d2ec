// When a process that ended is started again: at once while that is rare, after growing pauses where it cannot live.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/base/time.hpp"

namespace invar::tools {

/// A rate, as systemd's StartLimit and the intensity of Erlang's supervisors. A cell runs for years, so restarts are never given
/// up. A process that dies at once would take the CPU, so restarts are bounded in rate. Time counts while the process runs.
class Restarts {
 public:
  static constexpr std::size_t at_once = 5;  // so many ends within `window` ...
  static constexpr Duration window =
      Duration::seconds(60.0);  // ... of running are followed by a start at once
  static constexpr Duration first_pause = Duration::seconds(1.0);
  static constexpr Duration longest_pause = Duration::seconds(30.0);

  /// It ended after so long a life. How long to wait before it is started again.
  Duration ended_after(Duration life) {
    ++count_;
    ran_ += life;
    ends_.push_back(ran_);
    std::erase_if(ends_, [this](Duration end) { return ran_ - end > window; });
    if (ends_.size() <= at_once) return {};
    Duration pause = first_pause;
    for (std::size_t i = at_once + 1; i < ends_.size() && pause < longest_pause; ++i) pause = pause + pause;
    return std::min(pause, longest_pause);
  }
  /// Since `invar run` began.
  [[nodiscard]] std::uint32_t count() const { return count_; }
  /// Ends within the last minute of running.
  [[nodiscard]] std::size_t recent() const { return ends_.size(); }

 private:
  std::uint32_t count_ = 0;
  Duration ran_;
  std::vector<Duration> ends_;  // at which sum of running
};

}  // namespace invar::tools
