// Publishing: the thread that carries samples from a loop's rings to the middleware, so that the loop makes
// no call that could lock or allocate.
#pragma once

#include <atomic>
#include <optional>
#include <thread>
#include <vector>

#include "core/dds/bell.hpp"
#include "core/dds/wire_type.hpp"

namespace invar::dds {

/// The end of a loop's cycle wakes this thread. Where the thread shares the loop's core with a lower priority, it runs the
/// moment the loop sleeps.
class Publishing {
 public:
  ~Publishing() { stop(); }
  /// Set-up only.
  void add(Outlet& outlet) { outlets_.push_back(&outlet); }
  void start(int priority, std::optional<int> cpu);
  /// Wakes the thread if a sample waits. *Real-time*: at most one FUTEX_WAKE.
  void cycle_ended() noexcept;
  /// Drains what is left.
  void stop();

 private:
  void run();
  std::size_t drain();

  std::vector<Outlet*> outlets_;
  Bell bell_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace invar::dds
