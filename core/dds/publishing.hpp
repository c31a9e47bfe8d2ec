// Publishing: the thread that carries samples from a loop's rings to the middleware, so that the loop makes
// no call that could lock, allocate or enter the kernel.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
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
  /// `ended` gives the nominal start of the loop's newest finished cycle; wait-free. Without it the thread goes by
  /// the samples, and may look in the middle of a cycle.
  void start(int priority, std::optional<int> cpu, std::function<Instant()> ended);
  /// Drains what is left.
  void stop();

 private:
  void run();
  std::size_t drain();
  [[nodiscard]] Instant newest() const;

  std::vector<Outlet*> outlets_;
  Duration period_{INT64_MAX};
  std::function<Instant()> ended_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace invar::dds
