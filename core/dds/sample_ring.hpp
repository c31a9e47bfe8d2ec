// SampleRing: the newest samples of one writer in shared memory, for readers of the same PC. One writer thread, several
// readers; neither waits for the other.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/dds/shared_file.hpp"

namespace invar::dds {

/// The GUID of a writer or reader, in the order of its bytes on the wire.
using EndpointId = std::array<std::uint8_t, 16>;

class SampleRing {
 public:
  /// Samples that the ring keeps: at 10 kHz a reader may be 1.5 ms late and miss none.
  static constexpr std::uint64_t depth = 16;
  /// Readers that may attach; further readers get the samples by the middleware alone.
  static constexpr std::size_t most_readers = 8;
  /// Larger samples are for the middleware: a ring of them would be copied twice in the loop.
  static constexpr std::size_t largest_sample = 8192;

  /// For a writer whose samples take `sample_size` bytes at most. nullptr: no shared memory for it.
  [[nodiscard]] static std::unique_ptr<SampleRing> make(const EndpointId& writer, std::size_t sample_size);
  /// nullptr: the writer has none that this process can map, or the file is none of this version.
  [[nodiscard]] static std::unique_ptr<SampleRing> open(const EndpointId& writer);

  // --- the writer's thread; real-time

  [[nodiscard]] bool has_readers() const noexcept;
  /// Room for the next sample; `commit` makes its first `size` bytes visible.
  [[nodiscard]] std::span<std::byte> begin() noexcept;
  void commit(std::size_t size) noexcept;

  // --- any thread

  /// Counts how often readers came and went.
  [[nodiscard]] std::uint64_t changes() const noexcept;
  [[nodiscard]] bool is_attached(const EndpointId& reader) const noexcept;
  void detach(const EndpointId& reader) noexcept;

  // --- a reader's thread

  /// False: no place is left. The reader begins with the next sample.
  [[nodiscard]] bool attach(const EndpointId& reader) noexcept;
  /// Leaves out all samples up to now; false if there are none.
  bool skip() noexcept;
  /// Hands over each sample since the last call, oldest first; returns how many were overwritten before.
  std::uint64_t read(const std::function<void(std::span<const std::byte>)>& take);

 private:
  struct Header;
  struct Entry;
  explicit SampleRing(std::unique_ptr<SharedFile> file);
  [[nodiscard]] Header& header() const noexcept;
  [[nodiscard]] Entry& entry(std::uint64_t number) const noexcept;

  std::unique_ptr<SharedFile> file_;
  std::size_t sample_size_;
  std::uint64_t next_ = 0;  // of the reader
  std::vector<std::byte> copy_;
};

}  // namespace invar::dds
