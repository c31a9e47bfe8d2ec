#include "core/dds/memory_plan.hpp"

#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace invar::dds {

namespace {

std::string megabytes(std::uint64_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g MB", static_cast<double>(bytes) / 1e6);
  return text;
}

constexpr const char* mend = "mount -o remount,size=1G /dev/shm, in a container --shm-size=1g";
constexpr const char* off = "`shared_memory: false` in the cell file";

}  // namespace

std::uint64_t MemorySizes::total() const {
  if (!any()) return 0;
  // Measured on Fast DDS 2.9.1 with queues of 512 and 1024: what manages a segment, and a port with its 1024 places for
  // listeners; each rounded up to whole pages.
  constexpr std::uint64_t port = (48U << 10U) + 32U * queue, managing = 4096 + 64U * queue,
                          semaphores = 4U * 4096;
  return segment + managing + 2 * port + semaphores;
}

MemorySizes wanted_memory(Traffic traffic, std::uint32_t general_segment) {
  // A segment holds several of the largest samples, or samples of that size are lost or slow.
  if (traffic == Traffic::realtime) return {512U << 10U, 65'500};
  return {general_segment, general_segment / 2};
}

MemoryPlan plan_memory(Traffic traffic, std::uint32_t general_segment, std::size_t processes,
                       const std::filesystem::path& folder) {
  const std::string by_udp = traffic == Traffic::realtime ? "the loop's traffic goes by UDP"
                                                          : "all but the loop's traffic goes by UDP";
  struct statvfs room {};
  if (statvfs(folder.c_str(), &room) != 0)
    return {{}, "there is no " + folder.string() + ": " + by_udp + "; mount a tmpfs there, or say " + off};
  if (access(folder.c_str(), W_OK) != 0)
    return {{}, folder.string() + " cannot be written: " + by_udp + "; mount it writable, or say " + off};
  const MemorySizes wanted = wanted_memory(traffic, general_segment);
  const std::uint64_t whole = room.f_blocks * room.f_frsize,
                      part = whole / std::max<std::size_t>(1, processes);
  const std::uint64_t loop = traffic == Traffic::realtime ? 0 : wanted_memory(Traffic::realtime, 0).total();
  const std::uint64_t free =
      std::min<std::uint64_t>(room.f_bavail * room.f_frsize, part - std::min(part, loop));
  if (free >= wanted.total()) return {wanted, ""};
  const std::string has = folder.string() + " (" + megabytes(whole) + ") has " + megabytes(free) +
                          " for this, wanted are " + megabytes(wanted.total()) + ": ";
  constexpr std::uint32_t least = 256U << 10U;  // four of the largest datagrams
  MemorySizes less = wanted;
  for (less.segment /= 2; less.segment >= least; less.segment /= 2) {
    less.message = std::min(wanted.message, less.segment / 2);
    if (free >= less.total())
      return {less, has + "takes " + megabytes(less.total()) + ", samples above " +
                        megabytes(less.segment / 2) + " may be lost; " + mend};
  }
  return {{}, has + by_udp + "; " + mend};
}

}  // namespace invar::dds
