// The clocks of a process: CLOCK_MONOTONIC, by which loops keep time, and UTC, which the samples carry.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "core/base/time.hpp"

namespace invar {

/// CLOCK_MONOTONIC. Real-time.
[[nodiscard]] Instant monotonic_now() noexcept;

/// UTC as monotonic time plus an offset. When UTC is set anew the offset follows at `slew`, so that the sum neither
/// jumps nor goes back: whatever was made later carries the later stamp.
class SlewedClock {
 public:
  static constexpr std::int64_t slew = 2000;  // one nanosecond in so many: 500 us a second, as adjtime does
  explicit SlewedClock(Duration offset) noexcept;

  /// UTC at an instant of the monotonic clock. Any thread, real-time.
  [[nodiscard]] Instant at(Instant monotonic) const noexcept;
  /// From `monotonic` on the offset goes towards `target`. One thread at a time, never the loop's.
  void aim(Duration target, Instant monotonic) noexcept;

 private:
  struct Leg {
    std::atomic<std::int64_t> begin{0}, from{0}, target{0};
  };
  // The writer fills the leg that is not in use and then turns: a reader looks again when the writer turned meanwhile, but
  // never waits for it.
  std::array<Leg, 2> legs_;
  std::atomic<std::uint64_t> turn_{0};
};

/// The clock of this process's samples in real time: UTC, nanoseconds since 1970, read once when first asked for and then
/// counted on by the monotonic clock. Any thread, real-time (after the first call).
[[nodiscard]] Instant utc_now() noexcept;
/// The same at an instant of the monotonic clock.
[[nodiscard]] Instant utc_at(Instant monotonic) noexcept;
/// How far the host's UTC is ahead of its monotonic clock.
[[nodiscard]] Duration system_offset() noexcept;
/// At the start of a process, before the first `utc_now()`: its stamps go on from those of its launcher. A process that
/// is started again after somebody set UTC must not stamp behind its former life.
void continue_stamps(Duration offset) noexcept;
/// Looks again what the host takes for UTC and lets utc_now() follow slowly. Returns how far the host is ahead. Now and
/// then, from one thread that is not the loop's.
Duration follow_utc() noexcept;

}  // namespace invar
