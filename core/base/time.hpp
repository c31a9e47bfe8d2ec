// Instant and Duration: whole nanoseconds, so that a million cycles add up exactly.
#pragma once

#include <compare>
#include <cstdint>

namespace invar {

/// A span of time in nanoseconds.
struct Duration {
  std::int64_t ns = 0;

  static constexpr Duration seconds(double s) {
    return {static_cast<std::int64_t>(s * 1e9 + (s < 0 ? -0.5 : 0.5))};
  }
  static constexpr Duration milliseconds(std::int64_t ms) { return {ms * 1'000'000}; }
  static constexpr Duration microseconds(std::int64_t us) { return {us * 1'000}; }
  [[nodiscard]] constexpr double in_seconds() const { return static_cast<double>(ns) * 1e-9; }

  constexpr auto operator<=>(const Duration&) const = default;
  constexpr Duration operator-() const { return {-ns}; }
  constexpr Duration operator+(Duration other) const { return {ns + other.ns}; }
  constexpr Duration operator-(Duration other) const { return {ns - other.ns}; }
  constexpr Duration operator*(std::int64_t factor) const { return {ns * factor}; }
  constexpr Duration operator/(std::int64_t divisor) const { return {ns / divisor}; }
  constexpr Duration& operator+=(Duration other) { return ns += other.ns, *this; }
};

/// A point in time: nanoseconds since the clock's own zero (1970 for UTC, the start of simulated time, or that of
/// CLOCK_MONOTONIC).
struct Instant {
  std::int64_t ns = 0;

  [[nodiscard]] constexpr double in_seconds() const { return static_cast<double>(ns) * 1e-9; }

  constexpr auto operator<=>(const Instant&) const = default;
  constexpr Instant operator+(Duration d) const { return {ns + d.ns}; }
  constexpr Instant operator-(Duration d) const { return {ns - d.ns}; }
  constexpr Duration operator-(Instant other) const { return {ns - other.ns}; }
  constexpr Instant& operator+=(Duration d) { return ns += d.ns, *this; }
};

}  // namespace invar
