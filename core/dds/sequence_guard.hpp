// SequenceGuard: how far the sequence numbers of a writer may leap. The library walks from the old number to the new one.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>

#include "core/base/time.hpp"
#include "core/dds/rtps_message.hpp"

namespace invar::dds {

/// Remembers the newest number of each writer that discovery has shown; the library listens to no others. The table is of
/// fixed size, so that nobody fills the memory; a writer beyond it is not guarded.
class SequenceGuard {
 public:
  SequenceGuard();

  /// How the library takes a number: a sample it only files; to the number of a heartbeat or a gap it walks.
  enum class Step : std::uint8_t { filed, walked };

  /// A message may be this far above the newest number: what a sender may lose in a burst.
  static constexpr std::int64_t leap = 1 << 16;
  /// While nothing comes the allowance grows: by more than the fastest profiles send in a second, best-effort and reliable.
  static constexpr std::int64_t filed_rate = 1 << 16;
  static constexpr std::int64_t walked_rate = 1 << 12;
  /// A writer's first heartbeat or gap: more than a year of a hundred reliable samples a second.
  static constexpr std::int64_t first_walked = std::int64_t{1} << 32;
  /// No number at all lies above this: a year of `filed_rate`.
  static constexpr std::int64_t last = std::int64_t{1} << 41;

  /// Discovery: any thread, may wait.
  void know(const GuidPrefix& prefix, std::uint32_t entity);
  void forget(const GuidPrefix& prefix, std::uint32_t entity);
  void forget(const GuidPrefix& prefix);

  /// Receiving: any thread, without locks. Whether `number` may come next; if so it is remembered.
  [[nodiscard]] bool admits(const GuidPrefix& prefix, std::uint32_t entity, std::int64_t number, Step step,
                            Instant now);

  /// Sending: a sample went out in so many fragments. Any thread, without locks.
  void sent(std::uint32_t writer, std::int64_t number, std::uint32_t fragments);
  /// Whether our sample has a fragment of this number; true where it is not known any more.
  [[nodiscard]] bool has_fragment(std::uint32_t writer, std::int64_t number, std::uint32_t fragment) const;

 private:
  struct Entry {
    std::atomic<std::uint64_t> writer{0};  // 0: free
    std::atomic<std::int64_t> number{0};
    std::atomic<std::int64_t> time_ns{0};
    std::uint64_t prefix = 0;  // under the mutex
  };
  struct Sent {
    std::atomic<std::uint64_t> sample{0};
    std::atomic<std::uint32_t> fragments{0};
  };
  static constexpr std::size_t buckets = 256;
  static constexpr std::size_t ways = 16;
  static constexpr std::size_t samples = 1024;

  [[nodiscard]] Entry* find(std::uint64_t key, std::uint64_t in_bucket_of) const;

  std::mutex mutex_;
  std::unique_ptr<std::array<Entry, buckets * ways>> entries_;
  std::unique_ptr<std::array<Sent, samples>> sent_;
};

}  // namespace invar::dds
