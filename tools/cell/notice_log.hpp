// Notices of a process as lines of its log, from warning up: for who watches a terminal or reads a journal.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "core/component/channel.hpp"
#include "core/component/port.hpp"
#include "idl/event.h"

namespace invar::tools {

class NoticeLog {
 public:
  /// `simulated`: lines name the time of the cell, which is not that of the log.
  explicit NoticeLog(bool simulated) : simulated_{simulated} {}

  /// Set-up: what a component says on this port; any other port is left alone.
  void follow(Port& port);
  /// Writes what the components have said since the last call, and how often texts were said again. One thread.
  void write_waiting();
  /// The same at the end, when no count has to wait any more.
  void write_last();
  /// Any thread. A text that its source says again within ten seconds is counted; the count is told after them.
  void write(const event::Notice& notice);

 private:
  using Time = std::chrono::steady_clock::time_point;
  struct Said {
    Time at;
    std::uint64_t more = 0;
    event::Notice newest{};
  };
  void write_repeated(std::chrono::steady_clock::duration after);
  void write_line(const event::Notice& notice, std::uint64_t more) const;

  bool simulated_;
  std::deque<Ring<event::Notice>> waiting_;  // one a port, from its loop; addresses stay
  std::uint64_t told_lost_ = 0;
  Time next_count_{};
  std::mutex mutex_;
  std::map<std::pair<std::string, std::string>, Said> said_;  // by source and text
};

}  // namespace invar::tools
