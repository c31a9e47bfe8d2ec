#include "core/dds/shared_memory_calls.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/dds/port_memory.hpp"

namespace {

constexpr std::string_view prefix = "/fastrtps_";

/// "/fastrtps_" and 16 hexadecimal digits; ports have a name instead.
bool is_segment(std::string_view name) {
  return name.size() == prefix.size() + 16 && name.starts_with(prefix) &&
         std::all_of(name.begin() + prefix.size(), name.end(),
                     [](char c) { return std::isxdigit(static_cast<unsigned char>(c)) != 0; });
}

/// A segment without messages, which Boost.Interprocess takes for a whole one: its first word says "initialised". The place of a
/// message that is looked up lies among the first of a segment, 16 bytes for each of the 1024 that a queue holds.
int open_empty_segment() {
  constexpr std::uint32_t initialised = 2;
  constexpr off_t size = 256 << 10;
  const int file = memfd_create("fastrtps_empty", MFD_CLOEXEC);
  if (file >= 0 && (syscall(SYS_ftruncate, file, size) != 0 ||
                    pwrite(file, &initialised, sizeof initialised, 0) != sizeof initialised)) {
    close(file);
    return -1;
  }
  return file;
}

/// Whether a file is shared memory of Fast DDS.
bool is_shared_memory(int file) {
  char target[64];
  const auto link = "/proc/self/fd/" + std::to_string(file);
  const ssize_t size = readlink(link.c_str(), target, sizeof target);
  return size > 0 && std::string_view{target, static_cast<std::size_t>(size)}.starts_with(
                         "/dev/shm" + std::string{prefix});
}

}  // namespace

extern "C" {

int shm_open(const char* name, int flags, mode_t mode) {
  using Call = int (*)(const char*, int, mode_t);
  static const auto call = reinterpret_cast<Call>(dlsym(RTLD_NEXT, "shm_open"));
  const int file = call(name, flags, mode);
  if (file >= 0) invar::dds::note_opened_port(name, file);
  if (file >= 0 || (flags & O_CREAT) != 0 || (errno != ENOENT && errno != EACCES) || !is_segment(name))
    return file;
  return open_empty_segment();
}

int ftruncate(int file, off_t size) noexcept {
  if (size > 0 && is_shared_memory(file) && syscall(SYS_fallocate, file, 0, off_t{0}, size) != 0) return -1;
  return static_cast<int>(syscall(SYS_ftruncate, file, size));
}

}  // extern "C"

namespace invar::dds {

bool shared_memory_calls_are_ours() {
  return dlsym(RTLD_DEFAULT, "shm_open") == reinterpret_cast<void*>(&::shm_open) &&
         dlsym(RTLD_DEFAULT, "ftruncate") == reinterpret_cast<void*>(&::ftruncate);
}

}  // namespace invar::dds
