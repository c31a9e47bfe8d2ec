// How much shared memory a process needs for what it writes.
#pragma once

#include <cstdint>
#include <typeindex>
#include <vector>

namespace invar::dds {

/// Room for eight of the largest sample among these types, so that one waits for its readers while others are written [bytes].
/// At least 1 MiB: a message takes half of it, and the services of every process need 0.43 MB at most. At most 16 MiB: frames
/// of a camera. In the end every listening process of the PC has touched all of it, once for each of its participants.
[[nodiscard]] std::uint32_t segment_size_for(const std::vector<std::type_index>& written);

}  // namespace invar::dds
