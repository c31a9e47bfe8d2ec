// What killed processes leave in shared memory, and its removal.
#pragma once

#include <cstddef>
#include <filesystem>

#include "core/base/time.hpp"

namespace invar::dds {

/// Fast DDS holds a lock on a file "..._el" or "..._sl" beside each segment and port as long as its owner lives; a killed
/// process leaves them unlocked, half a megabyte and more each, until memory is full. Removes segments and ports whose
/// lock nobody holds and that are older than `age` (a younger one may be about to be locked). Returns how many. Called
/// by every node that uses shared memory. Set-up only.
std::size_t remove_shared_memory_leftovers(const std::filesystem::path& folder = "/dev/shm",
                                           Duration age = Duration::milliseconds(1000));

}  // namespace invar::dds
