// Pacer: on which cycle the loop is, when the next one is due, and what a lost period leads to. Pure
// arithmetic on whole nanoseconds; it neither sleeps nor looks at a clock.
#pragma once

#include <cstdint>

#include "core/base/time.hpp"
#include "core/executor/options.hpp"

namespace invar {

class Pacer {
 public:
  Pacer(Duration period, OverrunPolicy policy, std::uint32_t tolerated, Instant start);

  /// The number of the next cycle: start + cycle * period is when it is due.
  [[nodiscard]] std::uint64_t cycle() const noexcept { return cycle_; }
  [[nodiscard]] Instant due() const noexcept { return start_ + period_ * static_cast<std::int64_t>(cycle_); }

  /// The loop woke up at `now` to run cycle(). Whole periods that are gone are left out; returns how many.
  std::uint64_t wake(Instant now) noexcept;
  /// The cycle's work was done at `now`; goes on to the next. True when the next one was due before that.
  bool finish(Instant now) noexcept;

  /// Times that at least one period was lost: finished too late, or woken too late by a period or more.
  [[nodiscard]] std::uint64_t overruns() const noexcept { return overruns_; }
  /// Periods in which nothing ran.
  [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }
  /// Periods from one cycle to the next: 1, or 2, 4, 8 while degraded.
  [[nodiscard]] std::uint32_t stretch() const noexcept { return stretch_; }
  /// More was lost than the policy safe_stop puts up with. Cleared by the next question.
  [[nodiscard]] bool take_stop() noexcept {
    const bool stop = stop_;
    stop_ = false;
    return stop;
  }

 private:
  void lost() noexcept;
  [[nodiscard]] std::uint64_t next_multiple(std::uint64_t cycle) const noexcept {
    return (cycle + stretch_ - 1) / stretch_ * stretch_;
  }
  void close_window() noexcept;

  Duration period_;
  OverrunPolicy policy_;
  std::uint32_t tolerated_;
  Instant start_;
  std::uint64_t cycle_ = 0, overruns_ = 0, skipped_ = 0;
  std::uint32_t stretch_ = 1;
  bool stop_ = false, counted_ = false;
  // the current second
  std::uint64_t window_cycles_, window_end_;
  std::uint32_t lost_in_window_ = 0;
  Duration longest_in_window_;
};

}  // namespace invar
