// Bell: wakes a sleeping thread, also of another process, without waiting for anybody. A futex word.
#pragma once

#include <atomic>
#include <cstdint>

#include "core/base/time.hpp"

namespace invar::dds {

/// Lies in memory that the ringing and the sleeping thread share. The sleeping thread's process owns the memory, so
/// that a killed process leaves no count of sleepers behind.
struct Bell {
  std::atomic<std::uint32_t> rung{0};
  std::atomic<std::uint32_t> sleeping{0};
};
static_assert(std::atomic<std::uint32_t>::is_always_lock_free);

/// Wakes every sleeper. *Real-time*: one system call (FUTEX_WAKE), and that only if a thread sleeps.
void ring(Bell& bell) noexcept;

/// Sleeps until the bell has been rung since `rung` was read from it, or `patience` is over.
void sleep_on(Bell& bell, std::uint32_t rung, Duration patience) noexcept;

}  // namespace invar::dds
