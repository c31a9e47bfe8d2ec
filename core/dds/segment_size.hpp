// How much shared memory a process needs for what it writes.
#pragma once

#include <cstdint>
#include <typeindex>
#include <vector>

namespace invar::dds {

/// Room for eight of the largest sample among these types, so that one waits for its readers while others are written: 1 MiB (a
/// message takes half of it; the services of every process need 0.43 MB at most) to 16 MiB (frames of a camera) [bytes]. In the
/// end every process of the PC that listens has touched all of it, once for each of its participants.
[[nodiscard]] std::uint32_t segment_size_for(const std::vector<std::type_index>& written);

}  // namespace invar::dds
