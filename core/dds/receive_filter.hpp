// ReceiveFilter: stands between the network and the middleware, and keeps from it what it could not survive.
#pragma once

#include <fastdds/rtps/transport/ChainingTransport.h>

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.hpp"
#include "core/dds/holder_id.hpp"
#include "core/dds/rtps_message.hpp"
#include "core/dds/sequence_guard.hpp"

namespace invar::dds {

/// State that the filters of one participant share: limits, known writers, counts of dropped messages. Any thread.
class Reception {
 public:
  explicit Reception(const RtpsLimits& limits) : limits_{limits} {}

  [[nodiscard]] const RtpsLimits& limits() const { return limits_; }
  [[nodiscard]] SequenceGuard& guard() { return guard_; }
  /// The writers that discovery shows; those of discovery itself belong to each participant.
  void know_participant(const GuidPrefix& prefix);

  /// The participant is ready to receive. Fast DDS 2.9.1 announces a participant earlier, and throws away what arrives until
  /// then. A quick peer's answer would be lost, and comes again only after up to 1.5 s.
  void open() { open_.store(true, std::memory_order_release); }
  /// Receiving threads: until `open`, one second at most.
  void wait_until_open();

  /// A receiving thread of a secured participant holds it while the middleware takes a message of discovery, handshake or keys.
  /// Fast DDS 2.9 has one place, without a lock, for the endpoints that a handshake is about to match. Two threads that discover
  /// two participants at once overwrite it, and one of the two is never trusted. A thread that takes the leave of a participant
  /// waits for the timer, the timer for a reader that another thread holds, and that one for the first: for ever.
  [[nodiscard]] std::mutex& acquaintance() { return acquaintance_; }

  /// From now on nothing of these participants arrives, not even that they live; ascending. Any thread.
  void revoke(std::vector<HolderId> holders);
  /// Receiving threads, without locks.
  [[nodiscard]] bool is_revoked(const GuidPrefix& source) const noexcept;
  [[nodiscard]] std::uint64_t of_revoked() const { return of_revoked_.load(std::memory_order_relaxed); }
  void drop_of_revoked() { of_revoked_.fetch_add(1, std::memory_order_relaxed); }

  /// Receiving threads, without locks.
  void drop(Flaw flaw, const eprosima::fastrtps::rtps::Locator_t& sender);
  /// Messages dropped since the start, of one cause or of all.
  [[nodiscard]] std::uint64_t dropped(Flaw flaw) const;
  [[nodiscard]] std::uint64_t dropped() const;
  /// A sentence for a person where messages were dropped since the last one; at most one in ten seconds.
  [[nodiscard]] std::optional<std::string> report(Instant now);

 private:
  RtpsLimits limits_;
  SequenceGuard guard_;
  std::mutex acquaintance_;
  using Holders = std::vector<HolderId>;
  std::mutex revoked_mutex_;
  std::vector<std::unique_ptr<const Holders>> lists_;  // a receiving thread may still read an earlier one
  std::atomic<const Holders*> revoked_{nullptr};
  std::atomic<std::uint64_t> of_revoked_{0};
  std::atomic<bool> open_{false};
  std::array<std::atomic<std::uint64_t>, flaws> dropped_{};
  std::atomic<std::uint64_t> sender_{0};  // IPv4 address and port of the last one; 0: this PC's shared memory
  std::array<std::uint64_t, flaws> told_{};
  Instant told_at_{INT64_MIN / 2};
};

/// The transport that `below` describes, behind a filter.
[[nodiscard]] eprosima::fastdds::rtps::TransportInterface* make_filter(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> below,
    std::shared_ptr<Reception> reception, bool parts_loopback = false);

/// A transport behind a filter. Fast DDS looks at the type of a descriptor to know that a participant has shared memory: so it
/// is derived from that of the transport.
template <class Below>
struct Filtered final : Below {
  std::shared_ptr<Reception> reception;
  /// The largest message to send [bytes]; zero: as large as one that is received. A participant writes for all of its
  /// transports at once and keeps to the smallest.
  std::uint32_t largest_sent = 0;
  /// There is a socket on the loopback and one on the network. Fast DDS would send each message to a peer by both: only the
  /// one that reaches the peer shall.
  bool parts_loopback = false;

  [[nodiscard]] eprosima::fastdds::rtps::TransportInterface* create_transport() const override {
    return make_filter(std::make_shared<Below>(*this), reception, parts_loopback);
  }
  using Below::max_message_size;
  [[nodiscard]] std::uint32_t max_message_size() const override {
    return largest_sent != 0 ? largest_sent : Below::max_message_size();
  }
};

}  // namespace invar::dds
