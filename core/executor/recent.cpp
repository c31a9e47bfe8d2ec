#include "core/executor/recent.hpp"

#include <algorithm>

namespace invar {

Percentiles RecentHistogram::since_older(const HistogramCopy& now) const {
  HistogramCopy recent = now.since(begins_.front());
  // The largest of the window is known to its bucket; the largest of all may be of an earlier time.
  for (std::size_t i = recent.counts.size(); i-- > 0;)
    if (recent.counts[i] > 0) {
      recent.max = std::min(recent.max, Duration{histogram::lower_edge(i + 1)});
      return recent.percentiles();
    }
  return {};
}

void RecentHistogram::turn(const HistogramCopy& now) { begins_ = {begins_.back(), now}; }

Recent RecentStatistics::look(const Executor& executor, Instant now) {
  if (histograms_.empty()) {
    histograms_.resize(3 + executor.size());
    begins_ = {now, now};
  }
  Recent recent;
  recent.window = now - begins_.front();
  const bool turns = now - begins_.back() >= half;
  std::size_t next = 0;
  const auto take = [&](const HistogramCopy& all) {
    RecentHistogram& histogram = histograms_[next++];
    const Percentiles percentiles = histogram.since_older(all);
    if (turns) histogram.turn(all);
    return percentiles;
  };
  recent.wake_up = take(executor.wake_up());
  recent.compute = take(executor.compute());
  recent.latency = take(executor.latency());
  for (std::size_t i = 0; i < executor.size(); ++i) recent.steps.push_back(take(executor.compute(i)));
  if (turns) begins_ = {begins_.back(), now};
  return recent;
}

}  // namespace invar
