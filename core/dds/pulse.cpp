#include "core/dds/pulse.hpp"

#include <pthread.h>
#include <sys/prctl.h>

#include <algorithm>
#include <chrono>

namespace invar::dds {

Pulse::Pulse(const char* name, Duration period, int priority, std::function<void()> act)
    : thread_{[this, name, period, act = std::move(act)] {
        prctl(PR_SET_NAME, name);
        prctl(PR_SET_TIMERSLACK, 1);
        const auto step = std::chrono::nanoseconds{period.ns};
        for (auto next = std::chrono::steady_clock::now(); !stopping_;) {
          act();
          next = std::max(next + step, std::chrono::steady_clock::now());
          std::this_thread::sleep_until(next);
        }
      }} {
  if (priority <= 0) return;
  sched_param parameters{};
  parameters.sched_priority = priority;
  (void)pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &parameters);
}

Pulse::~Pulse() {
  stopping_ = true;
  thread_.join();
}

}  // namespace invar::dds
