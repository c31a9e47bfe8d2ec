#include "core/executor/locked_memory.hpp"

#include <malloc.h>
#include <pthread.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>

#include "core/base/clock.hpp"

namespace invar {

namespace {

#ifdef __SANITIZE_THREAD__
constexpr std::size_t stack_size = 8 * 1024 * 1024;  // thread-local data of the sanitizer stands in it, too
#else
constexpr std::size_t stack_size = 512 * 1024;
#endif
constexpr int own_mapping = 256 * 1024;       // bytes; larger blocks are mappings of their own
constexpr int kept_at_the_top = 1024 * 1024;  // bytes of the heap that stay although they are free

enum class Extent { none, touched, whole };

/// What the loop runs through in any cycle.
constexpr std::array<std::string_view, 5> in_every_loop{"libc.so", "libm.so", "libstdc++.so", "libgcc_s.so",
                                                        "ld-linux"};

/// Rings in shared memory that the loop writes its samples into; other shared memory is the middleware's.
constexpr std::string_view own_shared = "/dev/shm/invar_";

struct Mapping {
  std::uintptr_t begin = 0, end = 0;
  std::string rights, path;
  [[nodiscard]] std::size_t size() const { return end - begin; }
};

/// One line of /proc/self/maps: "begin-end rights offset device inode path".
bool read(const std::string& line, Mapping& mapping) {
  std::istringstream words{line};
  char dash = 0;
  std::string offset, device, inode;
  mapping.path.clear();
  words >> std::hex >> mapping.begin >> dash >> mapping.end >> mapping.rights >> offset >> device >> inode;
  const bool good = !words.fail();
  std::getline(words >> std::ws, mapping.path);
  return good;
}

/// Stacks of threads lie behind a guard of one page.
bool is_stack_behind(const Mapping& guard, const Mapping& mapping) {
  return guard.rights.starts_with("---") && guard.end == mapping.begin &&
         guard.size() == static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

Extent extent_of(const Mapping& mapping, const Mapping& before, const std::string& program) {
  if (!mapping.rights.starts_with('r')) return Extent::none;
  if (mapping.rights.ends_with('s'))
    return mapping.path.starts_with(own_shared) ? Extent::whole : Extent::none;
  if (mapping.path.empty()) return is_stack_behind(before, mapping) ? Extent::none : Extent::whole;
  if (mapping.path.starts_with('[')) return mapping.path == "[heap]" ? Extent::whole : Extent::none;
  if (mapping.path == program) return Extent::whole;
  const std::string name = std::filesystem::path{mapping.path}.filename();
  const bool always = std::any_of(in_every_loop.begin(), in_every_loop.end(),
                                  [&](std::string_view start) { return name.starts_with(start); });
  return always ? Extent::whole : Extent::touched;
}

/// Why a call has failed; 0 where the range is gone by now, which the kernel calls ENOMEM as it does a limit that is reached.
int reason(int error, void* begin, std::size_t size) {
  const bool is_gone = error == ENOMEM && msync(begin, size, MS_ASYNC) != 0;
  return is_gone ? 0 : error;
}

int lock_own_stack() {
  pthread_attr_t attributes;
  if (const int error = pthread_getattr_np(pthread_self(), &attributes); error != 0) return error;
  void* begin = nullptr;
  std::size_t size = 0;
  pthread_attr_getstack(&attributes, &begin, &size);
  pthread_attr_destroy(&attributes);
  if (getpid() == gettid()) return 0;  // it grows; a loop has a thread of its own
  return mlock(begin, size) == 0 ? 0 : errno;
}

}  // namespace

void keep_memory_small() noexcept {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack_size);
  pthread_setattr_default_np(&attributes);
  pthread_attr_destroy(&attributes);
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_MMAP_THRESHOLD, own_mapping);
  mallopt(M_TRIM_THRESHOLD, kept_at_the_top);
}

int lock_memory() {
  int failure = lock_own_stack();
  const std::string program = std::filesystem::read_symlink("/proc/self/exe");
  std::ifstream maps{"/proc/self/maps"};
  Mapping before, mapping;
  for (std::string line; std::getline(maps, line); before = mapping) {
    if (!read(line, mapping)) continue;
    const Extent extent = extent_of(mapping, before, program);
    if (extent == Extent::none) continue;
    void* const begin = reinterpret_cast<void*>(mapping.begin);  // NOLINT: an address as the kernel names it
    const int result =
        extent == Extent::whole ? mlock(begin, mapping.size()) : mlock2(begin, mapping.size(), MLOCK_ONFAULT);
    if (result != 0 && failure == 0) failure = reason(errno, begin, mapping.size());
  }
  return failure;
}

std::string MemoryKeeper::look() {
  const Instant now = monotonic_now();
  if (!asked_ || told_ || now < due_) return "";
  due_ = now + Duration::seconds(1.0);
  const int error = lock_memory();
  if (error == 0) return "";
  told_ = true;
  return std::string{"memory that was mapped since the start is not locked ("} + std::strerror(error) +
         "); raise `memlock` in /etc/security/limits.conf (LimitMEMLOCK in systemd)";
}

}  // namespace invar
