// Guards for real-time claims: what a piece of code allocates, locks or asks of the kernel, counted or forbidden.
#pragma once

#include <cstdint>

namespace invar::support {

/// What the calling thread did since it began. Counted by functions that stand in front of malloc, free,
/// pthread_mutex_lock and their like: link invar_test_support into the test program.
struct ThreadCounts {
  std::uint64_t allocations = 0;  // malloc, calloc, realloc, aligned allocation, free
  std::uint64_t locks = 0;        // mutex, reader-writer lock, condition, semaphore
};
[[nodiscard]] ThreadCounts thread_counts() noexcept;

/// The two lines of a test:
///     const RealTimeGuard guard;
///     component.step(tick);
///     EXPECT_EQ(guard.violations(), 0U);
class RealTimeGuard {
 public:
  RealTimeGuard() noexcept : before_{thread_counts()} {}
  [[nodiscard]] std::uint64_t allocations() const noexcept {
    return thread_counts().allocations - before_.allocations;
  }
  [[nodiscard]] std::uint64_t locks() const noexcept { return thread_counts().locks - before_.locks; }
  [[nodiscard]] std::uint64_t violations() const noexcept { return allocations() + locks(); }

 private:
  ThreadCounts before_;
};

enum class Waking { forbidden, allowed };

/// From now on the calling thread may sleep (clock_nanosleep), look at clocks and, with `Waking::allowed`, wake others
/// (FUTEX_WAKE); any other system call kills the process with SIGSYS. For child processes (death tests): it cannot be
/// taken back. False: the kernel has no seccomp.
[[nodiscard]] bool forbid_system_calls(Waking waking = Waking::forbidden) noexcept;

}  // namespace invar::support
