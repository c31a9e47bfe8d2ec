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

/// What one writer's sequence numbers and times say.
struct Flow {
  std::uint64_t samples = 0;
  std::uint64_t missing = 0;  // by gaps in the numbers
  std::uint64_t bytes = 0;
  // of the intervals between source times, by Welford's recurrences [s]
  double mean = 0.0, squares = 0.0, shortest = 0.0, longest = 0.0;
  std::uint64_t intervals = 0;

  void add(const dds::RawSample& sample);
  /// Of the intervals [s].
  [[nodiscard]] double deviation() const;

 private:
  std::uint64_t last_sequence_ = 0;
  std::int64_t last_ns_ = 0;
};

/// Any thread.
class TopicWatch {
 public:
  using Wanted = std::function<bool(const std::string& topic)>;
  using Sink = std::function<void(const dds::Endpoint& writer, const dds::RawSample& sample)>;
  /// `sink`, where given, gets every sample, on threads of the middleware.
  TopicWatch(dds::Node& node, Wanted wanted, Sink sink = {});

  /// Begins to read the wanted topics that were discovered since the last call.
  void look();
  [[nodiscard]] std::size_t topics() const { return readers_.size(); }
  /// By topic and writer.
  [[nodiscard]] std::map<std::string, std::map<std::string, Flow>> flows() const;
  /// Samples that the middleware lost on this side.
  [[nodiscard]] std::uint64_t lost() const;

 private:
  dds::Node& node_;
  Wanted wanted_;
  Sink sink_;
  mutable std::mutex mutex_;
  std::map<std::string, std::map<std::string, Flow>> flows_;
  std::map<std::string, std::unique_ptr<dds::Connection>>
      readers_;  // last: nothing arrives before all else stands
};

}  // namespace invar::tools
