// Pulse: a thread that does one thing once a period.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "core/base/time.hpp"

namespace invar::dds {

/// Runs from its construction to its end; what was missed is not made up for.
class Pulse {
 public:
  /// `name`: of the thread, at most 15 letters. `priority` of SCHED_FIFO, where the system allows it; 0: the usual scheduling.
  Pulse(const char* name, Duration period, int priority, std::function<void()> act);
  ~Pulse();
  Pulse(const Pulse&) = delete;
  Pulse& operator=(const Pulse&) = delete;

 private:
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace invar::dds
