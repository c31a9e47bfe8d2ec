#include "core/dds/publishing.hpp"

#include <pthread.h>
#include <sys/prctl.h>

#include <algorithm>

namespace invar::dds {

namespace {
/// Samples that are written outside of cycles (safe values after a stop) wait no longer than this.
constexpr Duration longest_sleep = Duration::milliseconds(5);
}  // namespace

void Publishing::start(int priority, std::optional<int> cpu) {
  if (outlets_.empty() || thread_.joinable()) return;
  stopping_ = false;
  thread_ = std::thread{[this] { run(); }};
  if (cpu) {
    cpu_set_t cores;
    CPU_ZERO(&cores);
    CPU_SET(static_cast<std::size_t>(*cpu), &cores);
    (void)pthread_setaffinity_np(thread_.native_handle(), sizeof cores, &cores);
  }
  if (priority > 0) {
    sched_param parameters{};
    parameters.sched_priority = priority;
    (void)pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &parameters);
  }
}

void Publishing::stop() {
  if (thread_.joinable()) {
    stopping_ = true;
    ring(bell_);
    thread_.join();
  }
  drain();
}

std::size_t Publishing::drain() {
  std::size_t count = 0;
  for (Outlet* outlet : outlets_) count += outlet->drain();
  return count;
}

void Publishing::cycle_ended() noexcept {
  if (std::any_of(outlets_.begin(), outlets_.end(),
                  [](const Outlet* outlet) { return outlet->is_waiting(); }))
    ring(bell_);
}

void Publishing::run() {
  prctl(PR_SET_NAME, "invar-publish");
  prctl(PR_SET_TIMERSLACK, 1);
  while (!stopping_) {
    const std::uint32_t rung = bell_.rung.load(std::memory_order_acquire);
    if (drain() == 0) sleep_on(bell_, rung, longest_sleep);
  }
}

}  // namespace invar::dds
