// Statistics of the last seconds, beside those since the start: a loop that was slow an hour ago is not slow now.
#pragma once

#include <array>
#include <vector>

#include "core/base/time.hpp"
#include "core/executor/executor.hpp"

namespace invar {

/// Percentiles of what a histogram counted in the last `half` to twice `half` (in the beginning: since the start), out of
/// copies. One thread.
class RecentHistogram {
 public:
  [[nodiscard]] Percentiles since_older(const HistogramCopy& now) const;
  /// Half of the window is over.
  void turn(const HistogramCopy& now);

 private:
  std::array<HistogramCopy, 2> begins_;  // older, newer
};

struct Recent {
  Duration window;
  Percentiles wake_up, compute, latency;
  std::vector<Percentiles> steps;  // of each component
};

/// One thread, not the loop's.
class RecentStatistics {
 public:
  /// Long enough for 500 cycles of a worker at 100 Hz, short enough to show what changed.
  static constexpr Duration half = Duration::seconds(5.0);
  /// `now`: of the monotonic clock.
  [[nodiscard]] Recent look(const Executor& executor, Instant now);

 private:
  std::array<Instant, 2> begins_{Instant{INT64_MIN}, Instant{INT64_MIN}};
  std::vector<RecentHistogram> histograms_;
};

}  // namespace invar
