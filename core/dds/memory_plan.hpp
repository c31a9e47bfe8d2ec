// MemoryPlan: how much shared memory a participant takes, given what /dev/shm has left.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/dds/profile.hpp"

namespace invar::dds {

/// Sizes of one participant.
struct MemorySizes {
  std::uint32_t segment = 0;                    // messages on their way [bytes]
  std::uint32_t message = 0;                    // the largest [bytes]
  static constexpr std::uint32_t queue = 1024;  // messages that a port holds

  /// All that it takes of /dev/shm: the segment with what manages it, two ports, and their semaphores [bytes].
  [[nodiscard]] std::uint64_t total() const;
  /// Whether it uses shared memory at all.
  [[nodiscard]] bool any() const { return segment != 0; }
};

/// Where there is room. `general_segment` is the segment of the general traffic [bytes].
[[nodiscard]] MemorySizes wanted_memory(Traffic traffic, std::uint32_t general_segment);

struct MemoryPlan {
  MemorySizes sizes;  // none: UDP only
  std::string
      shortage;  // how much is there, how much is wanted, what is done, and the mend; empty: there is room
};

/// As wanted, or with a segment a half, a quarter and so on as large, or none. `processes` share the folder. Each takes at
/// most its part of the whole, so that the last to start are not left without. All samples in flight must fit the segment:
/// a smaller one costs messages where large samples (frames of a camera) come close together.
[[nodiscard]] MemoryPlan plan_memory(Traffic traffic, std::uint32_t general_segment,
                                     std::size_t processes = 1,
                                     const std::filesystem::path& folder = "/dev/shm");

}  // namespace invar::dds
