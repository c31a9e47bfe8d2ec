#include "core/dds/middleware_log.hpp"

#include <fastdds/dds/log/Log.hpp>

#include <algorithm>
#include <cctype>
#include <memory>
#include <mutex>
#include <set>
#include <utility>

namespace invar::dds {

namespace {

using Log = eprosima::fastdds::dds::Log;

struct Kept {
  std::mutex mutex;
  std::set<std::string> kinds;  // of a fixed set of places in the library
  std::vector<std::string> news;
  std::string newest;
};

Kept& kept() {
  static Kept one;
  return one;
}

/// A number in a message differs each time; its kind does not.
std::string kind_of(std::string text) {
  std::erase_if(text, [](unsigned char c) { return std::isdigit(c) != 0; });
  return text;
}

class Keeper final : public eprosima::fastdds::dds::LogConsumer {
  void Consume(const Log::Entry& entry) override {
    if (entry.kind != Log::Kind::Error) return;
    constexpr std::size_t most_kinds = 100;
    Kept& to = kept();
    const std::lock_guard lock{to.mutex};
    to.newest = entry.message;
    if (to.kinds.size() < most_kinds && to.kinds.insert(kind_of(entry.message)).second)
      to.news.push_back(entry.message);
  }
};

}  // namespace

void keep_middleware_log() {
  static const bool once = [] {
    (void)kept();  // outlives the library's thread
    Log::ClearConsumers();
    Log::RegisterConsumer(std::make_unique<Keeper>());
    return true;
  }();
  (void)once;
}

std::vector<std::string> take_middleware_errors() {
  const std::lock_guard lock{kept().mutex};
  return std::exchange(kept().news, {});
}

std::string newest_middleware_error() {
  Log::Flush();
  const std::lock_guard lock{kept().mutex};
  return kept().newest;
}

}  // namespace invar::dds
