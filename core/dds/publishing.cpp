#include "core/dds/publishing.hpp"

#include <pthread.h>
#include <sys/prctl.h>

#include <algorithm>
#include <cerrno>
#include <ctime>

#include "core/base/clock.hpp"

namespace invar::dds {

namespace {

void sleep_until(Instant time) {
  const timespec at{time.ns / 1'000'000'000, time.ns % 1'000'000'000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr) == EINTR) {
  }
}

}  // namespace

void Publishing::add(Outlet& outlet, Duration period) {
  outlets_.push_back(&outlet);
  period_ = std::min(period_, period);
}

void Publishing::start(int priority, std::optional<int> cpu, std::function<Instant()> ended) {
  if (outlets_.empty() || thread_.joinable()) return;
  ended_ = std::move(ended);
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
    thread_.join();
  }
  drain();
}

std::size_t Publishing::drain() {
  std::size_t count = 0;
  for (Outlet* outlet : outlets_) count += outlet->drain();
  return count;
}

Instant Publishing::newest() const {
  Instant newest{INT64_MIN};
  for (const Outlet* outlet : outlets_) newest = std::max(newest, outlet->newest());
  return newest;
}

void Publishing::run() {
  prctl(PR_SET_NAME, "invar-publish");
  prctl(PR_SET_TIMERSLACK, 1);
  const Duration nap = std::clamp(period_ / 16, Duration::microseconds(10), Duration::microseconds(20));
  Duration lag{};  // from a cycle's start to its usual end
  Instant last{INT64_MIN};
  int naps = 0;
  while (!stopping_) {
    // With an executor that tells the end of its cycles, look only then; otherwise whenever awake. What was
    // written outside of cycles (safe values after a stop) goes out too, a little later.
    const bool told = ended_ != nullptr;
    const Instant ended = told ? ended_() : Instant{INT64_MIN};
    const bool look = !told || ended != last || naps > 8;
    const bool found = (look && drain() > 0) || (told && ended != last);
    if (!found) {
      // Early, or the loop stands still; then look less often, but never seldom.
      ++naps;
      const bool idle = naps > 100;
      const Duration pause = idle ? std::max(nap, std::min(period_, Duration::milliseconds(5))) : nap;
      sleep_until(monotonic_now() + pause);
      continue;
    }
    lag = naps == 0 ? lag - nap / 16 : lag + nap / 2;
    lag = std::clamp(lag, Duration{}, period_ * 3 / 4);
    naps = 0;
    last = told ? ended : newest();
    const Instant next = last + period_ + lag;
    // The loop's clock may not be ours (simulated time), or a cycle came late: then do not trust the phase.
    const Instant after = monotonic_now();
    Duration pause = next - utc_at(after);
    if (pause < -period_ || pause > period_ * 2) pause = nap;
    sleep_until(after + pause);
  }
}

}  // namespace invar::dds
