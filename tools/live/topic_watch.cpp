#include "tools/live/topic_watch.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>

#include "tools/live/live_cell.hpp"

namespace invar::tools {

namespace {
constexpr std::int64_t second_ns = 1'000'000'000;
}

std::int64_t wall_clock_ns() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return now.tv_sec * second_ns + now.tv_nsec;
}

void Flow::add(const dds::RawSample& sample, std::int64_t arrived_ns) {
  // One that took a second less than all before says that those were kept for late comers.
  const std::int64_t delay = arrived_ns - sample.sent_ns;
  if (least_delay_ns_ != INT64_MAX && delay < least_delay_ns_ - second_ns) *this = {};
  least_delay_ns_ = std::min(least_delay_ns_, delay);
  arrived_ns_ = arrived_ns;
  ++samples;
  bytes += sample.cdr.size();
  if (last_sequence_ != 0 && sample.sequence > last_sequence_ + 1)
    missing += sample.sequence - last_sequence_ - 1;
  last_sequence_ = sample.sequence;
  if (samples > 1) {
    const double interval = static_cast<double>(sample.sent_ns - last_ns_) * 1e-9;
    shortest = intervals == 0 ? interval : std::min(shortest, interval);
    longest = intervals == 0 ? interval : std::max(longest, interval);
    span_ns += sample.sent_ns - last_ns_;
    const double step = interval - mean;
    mean += step / static_cast<double>(++intervals);
    squares += step * (interval - mean);
  }
  last_ns_ = sample.sent_ns;
}

double Flow::deviation() const {
  return intervals > 1 ? std::sqrt(squares / static_cast<double>(intervals - 1)) : 0.0;
}

Flow::Rate Flow::rate_since(const Flow& before, std::int64_t now_ns) const {
  // What was kept for late comers was forgotten meanwhile: then all is new.
  const Flow& from = before.intervals > intervals || before.samples > samples ? Flow{} : before;
  const double bytes_each = samples > 0 ? static_cast<double>(bytes) / static_cast<double>(samples) : 0.0;
  double rate = 0.0;
  if (intervals > from.intervals && span_ns > from.span_ns)
    rate = static_cast<double>(intervals - from.intervals) /
           (static_cast<double>(span_ns - from.span_ns) * 1e-9);
  else if (mean > 0.0 && static_cast<double>(now_ns - arrived_ns_) * 1e-9 < 2.0 * mean)
    rate = 1.0 / mean;
  return {rate, rate * bytes_each};
}

Flow::Rate rate_of(const Flows& now, const Flows& before, std::int64_t now_ns) {
  Flow::Rate sum;
  for (const auto& [writer, flow] : now) {
    const auto earlier = before.find(writer);
    sum += flow.rate_since(earlier == before.end() ? Flow{} : earlier->second, now_ns);
  }
  return sum;
}

TopicWatch::TopicWatch(dds::Node& node, Wanted wanted, Sink sink)
    : node_{node}, wanted_{std::move(wanted)}, sink_{std::move(sink)} {}

void TopicWatch::look() {
  std::map<std::string, std::vector<dds::Endpoint>> writers;
  for (auto& endpoint : node_.snapshot().endpoints)
    if (endpoint.is_writer && !endpoint.is_local && !readers_.contains(endpoint.topic) &&
        wanted_(endpoint.topic))
      writers[endpoint.topic].push_back(std::move(endpoint));
  for (const auto& [topic, ends] : writers) {
    {
      const std::lock_guard lock{mutex_};
      flows_[topic];
    }
    readers_[topic] = node_.raw_reader(topic, ends.front().type, reader_profile(ends),
                                       [this, end = ends.front()](const dds::RawSample& sample) {
                                         {
                                           const std::int64_t now = wall_clock_ns();
                                           const std::lock_guard lock{mutex_};
                                           flows_[end.topic][std::string{sample.writer}].add(sample, now);
                                         }
                                         if (sink_) sink_(end, sample);
                                       });
  }
}

bool TopicWatch::hears_all() const {
  return std::all_of(readers_.begin(), readers_.end(),
                     [](const auto& reader) { return reader.second->matched() > 0; });
}

std::map<std::string, Flows> TopicWatch::flows() const {
  const std::lock_guard lock{mutex_};
  return flows_;
}

std::uint64_t TopicWatch::lost() const {
  std::uint64_t sum = 0;
  for (const auto& [topic, reader] : readers_) sum += reader->lost();
  return sum;
}

}  // namespace invar::tools
