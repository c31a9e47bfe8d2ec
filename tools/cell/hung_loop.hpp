// HungLoop: whether the loop of a process makes no cycle any more.
#pragma once

#include <cstdint>
#include <mutex>

#include "core/base/clock.hpp"
#include "core/executor/executor.hpp"

namespace invar::tools {

/// Whether the loop makes no cycle any more: a step hangs. Any thread but the loop's.
class HungLoop {
 public:
  static constexpr const char* text = "its loop makes no cycle any more: a step hangs; end the process";
  bool look(const Executor& executor) {
    const std::lock_guard lock{mutex_};
    const Instant now = monotonic_now();
    const std::uint64_t cycles = executor.counters().executed;
    // A process that was stopped itself has not looked, and begins anew.
    const bool was_away = now - looked_ > Duration::seconds(1.0);
    looked_ = now;
    if (cycles != cycles_ || was_away) since_ = now;
    cycles_ = cycles;
    const Duration longest = Duration::seconds(2.0) + executor.options().period * 4;
    return executor.is_running() && now - since_ > longest;
  }

 private:
  std::mutex mutex_;
  Instant looked_, since_;
  std::uint64_t cycles_ = 0;
};

}  // namespace invar::tools
