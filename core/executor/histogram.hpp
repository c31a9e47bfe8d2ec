// Histogram of durations: fixed size, 3 % wide buckets from 1 ns to 17 s, filled by the loop, read by
// anybody.
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstdint>

#include "core/base/time.hpp"

namespace invar {

/// Log-linear: 32 equal buckets in every power of two (as HdrHistogram does), so the relative width is at
/// most 1/32 everywhere and values under 64 ns are exact.
namespace histogram {
inline constexpr int bits = 5;  // 2^5 buckets an octave
inline constexpr std::uint64_t fine = std::uint64_t{1} << bits;
inline constexpr int top = 34;  // values of 2^34 ns and above fall into the last bucket
inline constexpr std::size_t buckets = static_cast<std::size_t>(top - bits + 1) * fine;

/// The bucket of a value [ns]; negative ones count as zero.
[[nodiscard]] constexpr std::size_t bucket_of(std::int64_t ns) {
  if (ns <= 0) return 0;
  const auto value = static_cast<std::uint64_t>(ns);
  if (value < fine) return value;
  const int shift = static_cast<int>(std::bit_width(value)) - 1 - bits;
  const std::size_t index = (static_cast<std::size_t>(shift) << bits) + (value >> shift);
  return index < buckets ? index : buckets - 1;
}
/// The smallest value [ns] of a bucket.
[[nodiscard]] constexpr std::int64_t lower_edge(std::size_t bucket) {
  if (bucket < 2 * fine) return static_cast<std::int64_t>(bucket);
  const auto shift = bucket / fine - 1;
  return static_cast<std::int64_t>((fine + bucket % fine) << shift);
}
}  // namespace histogram

/// The figures that people ask for. All zero when nothing was counted.
struct Percentiles {
  std::uint64_t count = 0;
  Duration p50, p99, p999, max;
};

/// A copy to work with.
struct HistogramCopy {
  std::array<std::uint64_t, histogram::buckets> counts{};
  Duration max;

  [[nodiscard]] std::uint64_t count() const;
  /// The value below which the share `fraction` (0..1) of all values lies, interpolated inside its bucket.
  [[nodiscard]] Duration quantile(double fraction) const;
  [[nodiscard]] Percentiles percentiles() const;
  /// The counts since an earlier copy; `max` stays that of the whole.
  [[nodiscard]] HistogramCopy since(const HistogramCopy& earlier) const;
  void add(Duration value);
  void add(const HistogramCopy& other);
};

/// One writer; `add` is a load and a store of one word. Any number of readers, whenever they like.
class Histogram {
 public:
  /// Real-time.
  void add(Duration value) noexcept {
    auto& count = counts_[histogram::bucket_of(value.ns)];
    count.store(count.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    if (value.ns > max_ns_.load(std::memory_order_relaxed))
      max_ns_.store(value.ns, std::memory_order_relaxed);
  }
  /// By the writer.
  void clear() noexcept {
    for (auto& count : counts_) count.store(0, std::memory_order_relaxed);
    max_ns_.store(0, std::memory_order_relaxed);
  }
  /// Any thread. Values counted meanwhile may or may not be in it.
  [[nodiscard]] HistogramCopy copy() const noexcept {
    HistogramCopy out;
    for (std::size_t i = 0; i < counts_.size(); ++i)
      out.counts[i] = counts_[i].load(std::memory_order_relaxed);
    out.max = {max_ns_.load(std::memory_order_relaxed)};
    return out;
  }

 private:
  std::array<std::atomic<std::uint64_t>, histogram::buckets> counts_{};
  std::atomic<std::int64_t> max_ns_{0};
};

}  // namespace invar
