// Clocks of two PCs that do not agree: by how much, in words.
#pragma once

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string>

#include "core/base/clock.hpp"
#include "core/base/shown.hpp"
#include "core/base/time.hpp"

namespace invar::dds {

/// The clock of the middleware's stamps, not the slewed one of ours.
inline Instant system_now() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return {std::chrono::duration_cast<std::chrono::nanoseconds>(now).count()};
}

/// Age of a sample. The source timestamp of a process of Invar goes on where its host's clock is set, and so do our stamps; that
/// of another program follows the host's. The nearer one counts.
inline Duration age_by_nearer_clock(Instant sent) {
  const Duration by_host = system_now() - sent, by_stamps = utc_now() - sent;
  return std::abs(by_stamps.ns) < std::abs(by_host.ns) ? by_stamps : by_host;
}

inline std::string seconds_text(Duration time) {
  const double seconds = time.in_seconds();
  return shown(seconds < 100.0 ? seconds : std::round(seconds), seconds < 100.0 ? 3 : 12) + " s";
}

/// "the clock of A is 3 s behind that of B: set both by NTP or PTP"; `ahead` negative: behind.
inline std::string clocks_apart(const std::string& one, Duration ahead, const std::string& other) {
  const bool behind = ahead.ns < 0;
  return "the clock of " + one + " is " + seconds_text(behind ? Duration{} - ahead : ahead) +
         (behind ? " behind" : " ahead of") + " that of " + other + ": set both by NTP or PTP";
}

}  // namespace invar::dds
