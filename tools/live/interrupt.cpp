#include "tools/live/interrupt.hpp"

#include <signal.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

namespace invar::tools {

namespace {

std::atomic<bool> asked{false};

void ask(int) { asked = true; }

bool install() {
  struct sigaction action {};
  action.sa_handler = ask;
  // A line that is being written to a full pipe is written to its end.
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  return true;
}

}  // namespace

bool interrupted() {
  static const bool installed = install();
  return installed && asked.load();
}

bool sleep_for(Duration time) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::nanoseconds{time.ns};
  while (!interrupted()) {
    const auto left = end - Clock::now();
    if (left <= Clock::duration::zero()) return true;
    std::this_thread::sleep_for(std::min<Clock::duration>(left, std::chrono::milliseconds{20}));
  }
  return false;
}

}  // namespace invar::tools
