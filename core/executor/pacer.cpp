#include "core/executor/pacer.hpp"

#include <algorithm>

namespace invar {

Pacer::Pacer(Duration period, OverrunPolicy policy, std::uint32_t tolerated, Instant start)
    : period_{period},
      policy_{policy},
      tolerated_{tolerated},
      start_{start},
      window_cycles_{static_cast<std::uint64_t>(std::max<std::int64_t>(8, 1'000'000'000 / period.ns))},
      window_end_{window_cycles_} {}

std::uint64_t Pacer::wake(Instant now) noexcept {
  const std::int64_t late = (now - due()).ns;
  if (late < period_.ns) return 0;
  const auto gone = static_cast<std::uint64_t>(late / period_.ns);
  // While degraded only every stretch-th cycle was going to run: the others are not lost.
  const std::uint64_t left_out = gone / stretch_;
  cycle_ += gone;
  if (left_out == 0) return 0;
  skipped_ += left_out;
  if (!counted_) lost();
  return left_out;
}

bool Pacer::finish(Instant now) noexcept {
  longest_in_window_ = std::max(longest_in_window_, now - due());
  cycle_ = next_multiple(cycle_ + stretch_);
  const bool overran = now > due();
  if (overran) lost();
  cycle_ = next_multiple(cycle_);  // the rate may just have been halved
  counted_ = overran;              // the periods that wake() finds gone after this belong to the same event
  if (cycle_ >= window_end_) close_window();
  return overran;
}

void Pacer::lost() noexcept {
  ++overruns_;
  if (++lost_in_window_ <= tolerated_) return;
  if (policy_ == OverrunPolicy::safe_stop) stop_ = true;
  if (policy_ == OverrunPolicy::degrade && stretch_ < 8) {
    stretch_ *= 2;
    lost_in_window_ = 0;
    window_end_ = cycle_ + window_cycles_;  // a whole second without loss before the rate goes up again
  }
}

void Pacer::close_window() noexcept {
  // Half of the shorter period must have been enough, or the rate would go up and down for ever.
  const Duration shorter = period_ * static_cast<std::int64_t>(stretch_ / 2);
  if (stretch_ > 1 && lost_in_window_ == 0 && longest_in_window_ < shorter / 2) stretch_ /= 2;
  lost_in_window_ = 0;
  longest_in_window_ = {};
  window_end_ = cycle_ + window_cycles_;
}

}  // namespace invar
