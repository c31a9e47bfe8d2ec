#include "core/base/clock.hpp"

#include <algorithm>
#include <ctime>

namespace invar {

namespace {

Instant read(clockid_t clock) noexcept {
  timespec time{};
  clock_gettime(clock, &time);
  return {std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec};
}

/// Of a few readings the one that was interrupted the least.
Duration host_offset() noexcept {
  Duration best{};
  Duration width{INT64_MAX};
  for (int k = 0; k < 5; ++k) {
    const Instant before = read(CLOCK_MONOTONIC);
    const Instant utc = read(CLOCK_REALTIME);
    const Instant after = read(CLOCK_MONOTONIC);
    if (after - before >= width) continue;
    width = after - before;
    best = utc - (before + width / 2);
  }
  return best;
}

std::atomic<std::int64_t> continued_ns{0};  // 0: the host's

SlewedClock& process_clock() noexcept {
  static SlewedClock clock{continued_ns != 0 ? Duration{continued_ns} : host_offset()};
  return clock;
}

}  // namespace

Instant monotonic_now() noexcept { return read(CLOCK_MONOTONIC); }

SlewedClock::SlewedClock(Duration offset) noexcept {
  legs_[0].from = offset.ns;
  legs_[0].target = offset.ns;
}

Instant SlewedClock::at(Instant monotonic) const noexcept {
  for (;;) {
    const std::uint64_t turn = turn_.load(std::memory_order_acquire);
    const Leg& leg = legs_[turn % 2];
    const std::int64_t begin = leg.begin.load(std::memory_order_relaxed);
    const std::int64_t from = leg.from.load(std::memory_order_relaxed);
    const std::int64_t target = leg.target.load(std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_acquire);
    if (turn_.load(std::memory_order_relaxed) != turn) continue;
    const std::int64_t most = std::max<std::int64_t>(0, monotonic.ns - begin) / slew;
    return {monotonic.ns + from + std::clamp(target - from, -most, most)};
  }
}

void SlewedClock::aim(Duration target, Instant monotonic) noexcept {
  const std::uint64_t turn = turn_.load(std::memory_order_relaxed);
  std::atomic_thread_fence(
      std::memory_order_release);  // who sees the new leg half filled sees the turn before it too
  Leg& next = legs_[(turn + 1) % 2];
  const Duration reached = at(monotonic) - monotonic;
  next.begin.store(monotonic.ns, std::memory_order_relaxed);
  next.from.store(reached.ns, std::memory_order_relaxed);
  next.target.store(target.ns, std::memory_order_relaxed);
  turn_.store(turn + 1, std::memory_order_release);
}

void continue_stamps(Duration offset) noexcept { continued_ns = offset.ns; }

Instant utc_at(Instant monotonic) noexcept { return process_clock().at(monotonic); }
Instant utc_now() noexcept { return utc_at(monotonic_now()); }

Duration system_offset() noexcept { return host_offset(); }

Duration follow_utc() noexcept {
  // Both clocks of a host are steered alike, so that the offset only changes when somebody sets UTC; less than this is
  // how well it can be read.
  constexpr Duration noise = Duration::microseconds(20);
  const Duration host = host_offset();
  const Instant now = monotonic_now();
  const Duration ahead = host - (utc_at(now) - now);
  if (ahead > noise || ahead < -noise) process_clock().aim(host, now);
  return ahead;
}

}  // namespace invar
