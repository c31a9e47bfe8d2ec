// How much shared memory a process needs for what it writes.
#pragma once

#include <cstdint>
#include <typeindex>
#include <vector>

namespace invar::dds {

/// Room for eight of the largest sample among these types, so that one waits for its readers while others are written: 4 MiB (the
/// services of every process take half a megabyte at most) to 16 MiB (frames of a camera) [bytes]. The middleware touches all of
/// it when the process starts.
[[nodiscard]] std::uint32_t segment_size_for(const std::vector<std::type_index>& written);

}  // namespace invar::dds
