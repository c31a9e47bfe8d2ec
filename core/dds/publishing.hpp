// Publishing: the thread that carries samples from a loop's rings to the middleware, so that the loop makes
// no call that could lock, allocate or enter the kernel.
#pragma once

#include <atomic>
#include <thread>
#include <vector>

#include "core/base/time.hpp"
#include "core/dds/wire_type.hpp"

namespace invar::dds {

/// Nobody wakes this thread: that would cost the loop a system call. It knows the loop's phase from the cycle
/// that ended last, sleeps until just after the next one should end, looks, and takes short naps when it is
/// early. Where it shares the loop's core with a lower priority, it runs the moment the loop sleeps.
class Publishing {
 public:
  ~Publishing() { stop(); }
  /// Set-up only. `period` of the loop that writes.
  void add(Outlet& outlet, Duration period);
  /// By the loop. Real-time.
  void end_of_cycle(Instant start) noexcept { ended_ns_.store(start.ns, std::memory_order_release); }
  void start(int priority);
  /// Drains what is left.
  void stop();

 private:
  void run();
  std::size_t drain();
  [[nodiscard]] Instant newest() const;

  std::vector<Outlet*> outlets_;
  Duration period_{INT64_MAX};
  std::atomic<std::int64_t> ended_ns_{INT64_MIN};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace invar::dds
