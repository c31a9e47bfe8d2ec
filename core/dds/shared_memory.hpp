// Shared memory left by killed processes, and its removal.
#pragma once

#include <cstddef>
#include <filesystem>

#include "core/base/time.hpp"

namespace invar::dds {

/// Fast DDS holds a lock on a file "..._el" or "..._sl" beside each segment and port as long as its owner lives. A killed
/// process leaves them unlocked, half a megabyte and more each, until memory is full. Removes segments and ports whose
/// lock nobody holds and that are older than `age` (a younger one may be about to be locked). Each stays for `rest` from the
/// time it was first found so. Its peers write to its ports until they know that the process is dead, so nobody must take
/// its numbers. A peer that did not get to run meanwhile has messages in its segments. Fast DDS 2.9 never gets past a message
/// whose segment is gone, so that nothing would reach that peer any more. Returns how many were removed. Called by every node
/// that uses shared memory. Set-up only.
std::size_t remove_shared_memory_leftovers(const std::filesystem::path& folder = "/dev/shm",
                                           Duration age = Duration::milliseconds(1000),
                                           Duration rest = Duration::milliseconds(30'000));

}  // namespace invar::dds
