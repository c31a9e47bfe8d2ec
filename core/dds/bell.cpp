#include "core/dds/bell.hpp"

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <climits>
#include <ctime>

namespace invar::dds {

// Both sides write one word and then read the other: sequentially consistent, so that at least one sees the other's.
void ring(Bell& bell) noexcept {
  bell.rung.fetch_add(1, std::memory_order_seq_cst);
  if (bell.sleeping.load(std::memory_order_seq_cst) != 0)
    syscall(SYS_futex, &bell.rung, FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
}

void sleep_on(Bell& bell, std::uint32_t rung, Duration patience) noexcept {
  bell.sleeping.fetch_add(1, std::memory_order_seq_cst);
  if (bell.rung.load(std::memory_order_seq_cst) == rung) {
    const timespec time{patience.ns / 1'000'000'000, patience.ns % 1'000'000'000};
    syscall(SYS_futex, &bell.rung, FUTEX_WAIT, rung, &time, nullptr, 0);
  }
  bell.sleeping.fetch_sub(1, std::memory_order_seq_cst);
}

}  // namespace invar::dds
