// HostClocks: how far the clocks of other processes are ahead of this one's, measured by beats over DDS.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/base/time.hpp"
#include "idl/clock.h"

namespace invar::dds {

/// The clocks of this process at one instant.
struct ClockReading {
  Instant monotonic;
  Duration stamps;  // the clock of its stamps less the monotonic one
  Duration system;  // the host's UTC less the monotonic one
  static ClockReading now();
};

/// The clock (UTC) of another host.
struct HostClock {
  std::string host;
  Duration ahead;  // of this host's
  Duration
      error;  // half of the round trip: the offset lies within it, however the way there differs from the way back
};

/// Names a participant in beats.
[[nodiscard]] std::uint64_t participant_key(std::span<const unsigned char, 12> prefix) noexcept;

/// A stamp that came over DDS, so much earlier; whatever it is, the difference wraps around.
[[nodiscard]] inline std::int64_t earlier(std::int64_t stamp_ns, Duration by) noexcept {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(stamp_ns) - static_cast<std::uint64_t>(by.ns));
}

/// The offset of two monotonic clocks from four stamps (RFC 5905, 8), of the last 16 measurements the one with the shortest
/// round trip. Nobody sets a monotonic clock, so an offset holds while somebody sets a host's clock; how far stamps are from
/// it comes with each beat. Any thread.
class HostClocks {
 public:
  static constexpr Duration period = Duration::milliseconds(100);

  /// `hosts`: all of the cell. A beat in another name changes nothing, and is told.
  HostClocks(std::uint32_t cell, std::string host, std::vector<std::string> hosts);
  /// Set-up: one of this process.
  void add_participant(std::uint64_t key);
  [[nodiscard]] clock::Beat beat(const ClockReading& own);
  void heard(const clock::Beat& beat, const ClockReading& own);

  [[nodiscard]] bool knows(std::uint64_t participant) const noexcept { return find(participant) != nullptr; }
  /// How far the stamps of a participant are ahead of ours; 0 where that cannot be told from nothing, and of strangers. Takes
  /// no lock.
  [[nodiscard]] Duration stamps_ahead(std::uint64_t participant) const noexcept;
  /// The other hosts that were heard in the last 5 s, each by its process with the shortest round trip.
  [[nodiscard]] std::vector<HostClock> hosts(Instant monotonic) const;
  /// Names a host whose clock is further off than `bound`, by all of its processes; empty: there is none. Stamps are turned
  /// whatever the clocks say, but one that is far off is one that nobody keeps. A program that takes the name of a host says nothing
  /// against the processes that are there.
  [[nodiscard]] std::string farther_than(Duration bound) const;
  [[nodiscard]] const std::string& host() const { return host_; }
  /// Once for each name, of the first few: a program that compares clocks as a host that the cell does not have. Empty: none.
  [[nodiscard]] std::string take_stranger();

 private:
  struct Measurement {
    Duration offset, round_trip;
  };
  struct Peer {
    std::string host;
    Instant heard;
    std::int64_t sent_ns = 0;  // of its newest beat
    Duration system;
    std::array<Measurement, 16> last{};
    std::size_t count = 0;
  };
  struct Known {
    std::atomic<std::uint64_t> participant{0};
    std::atomic<std::int64_t> ahead_ns{0};
  };

  [[nodiscard]] static const Measurement& best(const Peer& peer);
  [[nodiscard]] bool is_heard(const Peer& peer, Instant monotonic) const;
  [[nodiscard]] Duration ahead_of_us(const Peer& peer) const;
  [[nodiscard]] const Known* find(std::uint64_t participant) const noexcept;
  void know(std::uint64_t participant, Duration ahead) noexcept;

  std::uint32_t cell_;
  std::string host_;
  std::vector<std::string> hosts_;
  std::set<std::string> strangers_;
  std::vector<std::string> untold_;
  std::uint64_t id_;
  mutable std::mutex mutex_;
  std::vector<std::uint64_t> participants_;
  std::map<std::uint64_t, Peer> peers_;
  Duration system_;  // of this host, at the last beat
  static constexpr std::size_t most_known = 256;
  std::array<Known, most_known> known_{};
};

}  // namespace invar::dds
