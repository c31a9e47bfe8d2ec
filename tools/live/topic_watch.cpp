#include "tools/live/topic_watch.hpp"

#include <algorithm>
#include <cmath>

#include "tools/live/live_cell.hpp"

namespace invar::tools {

void Flow::add(const dds::RawSample& sample) {
  ++samples;
  bytes += sample.cdr.size();
  if (last_sequence_ != 0 && sample.sequence > last_sequence_ + 1)
    missing += sample.sequence - last_sequence_ - 1;
  last_sequence_ = sample.sequence;
  if (last_ns_ != 0) {
    const double interval = static_cast<double>(sample.sent_ns - last_ns_) * 1e-9;
    shortest = intervals == 0 ? interval : std::min(shortest, interval);
    longest = intervals == 0 ? interval : std::max(longest, interval);
    const double step = interval - mean;
    mean += step / static_cast<double>(++intervals);
    squares += step * (interval - mean);
  }
  last_ns_ = sample.sent_ns;
}

double Flow::deviation() const {
  return intervals > 1 ? std::sqrt(squares / static_cast<double>(intervals - 1)) : 0.0;
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
                                           const std::lock_guard lock{mutex_};
                                           flows_[end.topic][std::string{sample.writer}].add(sample);
                                         }
                                         if (sink_) sink_(end, sample);
                                       });
  }
}

std::map<std::string, std::map<std::string, Flow>> TopicWatch::flows() const {
  const std::lock_guard lock{mutex_};
  return flows_;
}

std::uint64_t TopicWatch::lost() const {
  std::uint64_t sum = 0;
  for (const auto& [topic, reader] : readers_) sum += reader->lost();
  return sum;
}

}  // namespace invar::tools
