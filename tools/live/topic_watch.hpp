// Reads topics as bytes as they appear and counts: rates, gaps, intervals. For `top`, `hz` and `record`.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/dds/node.hpp"

namespace invar::tools {

/// Rate, jitter and losses by one writer's sequence numbers and times. Times are those of sending, by the writer's own clock.
/// Earlier samples that the writer keeps for late comers arrive in a burst and count for nothing.
struct Flow {
  std::uint64_t samples = 0;
  std::uint64_t missing = 0;  // by gaps in the numbers
  std::uint64_t bytes = 0;
  // of the intervals between source times, by Welford's recurrences [s]
  double mean = 0.0, squares = 0.0, shortest = 0.0, longest = 0.0;
  std::uint64_t intervals = 0;
  std::int64_t span_ns = 0;  // all intervals

  /// `arrived_ns`: on this PC's clock, which may be another than the writer's.
  void add(const dds::RawSample& sample, std::int64_t arrived_ns);
  /// Standard deviation of the intervals [s].
  [[nodiscard]] double deviation() const;
  /// Samples a second, bytes a second: what came since `before`, an earlier copy, over the time in which it was sent. A writer
  /// that sends less often than somebody looks keeps its rate until two of its intervals have passed in silence.
  struct Rate {
    double samples = 0.0, bytes = 0.0;
    Rate& operator+=(const Rate& other) { return samples += other.samples, bytes += other.bytes, *this; }
  };
  [[nodiscard]] Rate rate_since(const Flow& before, std::int64_t now_ns) const;

 private:
  std::uint64_t last_sequence_ = 0;
  std::int64_t last_ns_ = 0, arrived_ns_ = 0;
  std::int64_t least_delay_ns_ = INT64_MAX;  // of arriving; the clocks' difference is in it
};
using Flows = std::map<std::string, Flow>;  // by writer
/// The rate of a topic is the sum over its writers; `before` an earlier copy of `now`, or empty: since the start.
[[nodiscard]] Flow::Rate rate_of(const Flows& now, const Flows& before, std::int64_t now_ns);
/// CLOCK_REALTIME [ns].
[[nodiscard]] std::int64_t wall_clock_ns();

/// Any thread.
class TopicWatch {
 public:
  using Wanted = std::function<bool(const std::string& topic)>;
  using Sink = std::function<void(const dds::Endpoint& writer, const dds::RawSample& sample)>;
  /// `sink`, where given, gets every sample, on threads of the middleware.
  TopicWatch(dds::Node& node, Wanted wanted, Sink sink = {});

  /// Begins to read the wanted topics that were discovered since the last call.
  void look();
  /// Each topic that is read has found a writer; before that its rate is no rate.
  [[nodiscard]] bool hears_all() const;
  [[nodiscard]] std::size_t topics() const { return readers_.size(); }
  /// By topic and writer.
  [[nodiscard]] std::map<std::string, Flows> flows() const;
  /// Samples that the middleware lost on this side.
  [[nodiscard]] std::uint64_t lost() const;

 private:
  dds::Node& node_;
  Wanted wanted_;
  Sink sink_;
  mutable std::mutex mutex_;
  std::map<std::string, Flows> flows_;
  std::map<std::string, std::unique_ptr<dds::Connection>>
      readers_;  // last: nothing arrives before all else stands
};

}  // namespace invar::tools
