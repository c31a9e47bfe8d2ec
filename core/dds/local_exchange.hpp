// LocalExchange: samples of a real-time loop go to the other processes of this PC through shared memory, beside the
// topic. The middleware discovers who reads whom, and carries the samples to every reader that shares no memory.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <span>
#include <thread>
#include <vector>

#include "core/base/time.hpp"
#include "core/dds/bell.hpp"
#include "core/dds/sample_ring.hpp"

namespace invar::dds {

/// The first bytes of an EndpointId, which all endpoints of a participant share.
using ParticipantId = std::array<std::uint8_t, 12>;
[[nodiscard]] ParticipantId participant_of(const EndpointId& endpoint);

class LocalExchange;

/// One writer's side.
class LocalWriter {
 public:
  LocalWriter(LocalExchange& exchange, std::unique_ptr<SampleRing> ring);
  ~LocalWriter();
  LocalWriter(const LocalWriter&) = delete;
  LocalWriter& operator=(const LocalWriter&) = delete;

  // --- the loop's thread; real-time
  [[nodiscard]] bool has_readers() const noexcept { return ring_->has_readers(); }
  [[nodiscard]] std::span<std::byte> begin() noexcept { return ring_->begin(); }
  void commit(std::size_t size) noexcept;
  /// Whether a matched reader is not attached, and must get its samples by the middleware.
  [[nodiscard]] bool needs_middleware() const noexcept {
    return needs_middleware_.load(std::memory_order_relaxed);
  }

  // --- other threads
  void matched(const EndpointId& reader);
  void unmatched(const EndpointId& reader);
  /// Looks whether readers attached or left since the last call.
  void update();

 private:
  void decide();

  LocalExchange& exchange_;
  std::unique_ptr<SampleRing> ring_;
  std::mutex mutex_;
  std::map<EndpointId, std::uint32_t> bells_;  // of each matched reader: its bit
  std::atomic<std::uint32_t> mask_{0};
  std::atomic<bool> needs_middleware_{false};  // no reader, no need
  std::atomic<std::uint64_t> seen_changes_{0};
};

/// One reader's side; `deliver` is called on the exchange's thread.
class LocalReader {
 public:
  using Deliver = std::function<void(std::span<const std::byte> cdr)>;
  LocalReader(LocalExchange& exchange, Deliver deliver);
  ~LocalReader();
  LocalReader(const LocalReader&) = delete;
  LocalReader& operator=(const LocalReader&) = delete;

  void matched(const EndpointId& writer, const EndpointId& reader);
  void unmatched(const EndpointId& writer);
  /// Nothing is delivered after this.
  void end();
  /// Whether the samples of this writer come through shared memory: those on the topic are the same.
  [[nodiscard]] bool serves(const EndpointId& writer) const;
  /// Samples that were overwritten before they could be read.
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }

 private:
  friend class LocalExchange;
  struct Source {
    EndpointId reader;
    std::unique_ptr<SampleRing> ring;
    bool is_served = false;
  };
  // On the exchange's thread, under its mutex.
  /// True if a sample was there.
  bool read();
  /// From now on the samples of this writer come through shared memory alone.
  void serve(const EndpointId& writer, Source& source);
  /// A writer is discovered a moment before its ring is there: looks again, some times.
  void look_again();
  [[nodiscard]] bool attach(const EndpointId& writer, const EndpointId& reader);

  LocalExchange& exchange_;
  Deliver deliver_;
  struct Pending {
    EndpointId reader;
    int tries = 0;
  };
  std::map<EndpointId, Source> sources_;   // by writer; under the exchange's mutex
  std::map<EndpointId, Pending> pending_;  // likewise
  mutable std::mutex served_mutex_;        // a thread of the middleware asks in the middle of a delivery
  std::set<EndpointId> served_;            // writers
  std::atomic<std::uint64_t> lost_{0};
};

/// One for each node. Set-up: any thread.
class LocalExchange {
 public:
  /// `own`: the participant whose readers sleep here. `priority`: SCHED_FIFO of the receiving thread; 0: the usual.
  LocalExchange(const ParticipantId& own, int priority);
  ~LocalExchange();
  LocalExchange(const LocalExchange&) = delete;
  LocalExchange& operator=(const LocalExchange&) = delete;

  /// nullptr: samples of that size, or this PC, have no shared memory.
  [[nodiscard]] std::shared_ptr<LocalWriter> writer(const EndpointId& id, std::size_t sample_size);
  [[nodiscard]] std::shared_ptr<LocalReader> reader(LocalReader::Deliver deliver);

  /// At the end of the loop's cycle: wakes each process for which a sample was written. *Real-time*; one FUTEX_WAKE a
  /// process whose thread sleeps.
  void wake_readers() noexcept;

 private:
  friend class LocalWriter;
  friend class LocalReader;
  /// Bells of other processes that may be open at a time.
  static constexpr std::size_t most_bells = 32;
  struct ForeignBell {
    ParticipantId participant{};
    std::unique_ptr<SharedFile> file;
    int users = 0;
    Instant left{};  // when the last user went
  };

  /// The bit of the participant's bell; 0: none that this process can open, or no place.
  [[nodiscard]] std::uint32_t open_bell(const ParticipantId& participant);
  void close_bell(std::uint32_t bit);
  void start_receiving();
  void receive();

  int priority_;
  std::uint32_t pending_ = 0;  // the loop's thread
  std::mutex bells_mutex_;
  std::array<ForeignBell, most_bells> bells_;
  std::array<std::atomic<Bell*>, most_bells> open_{};

  std::unique_ptr<SharedFile> own_bell_;
  std::mutex readers_mutex_;
  std::vector<LocalReader*> readers_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace invar::dds
