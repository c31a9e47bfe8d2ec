// Memory of a process with a real-time loop: small stacks, one heap, and what the loop touches locked.
#pragma once

#include <optional>
#include <string>

#include "core/base/time.hpp"
#include "core/config/cell.hpp"

namespace invar {

/// Before the first thread is made. Each thread gets a stack of 512 KiB instead of 8 MiB: the deepest model file that is
/// accepted (500 levels) takes 256 KiB. All threads share one heap, for glibc reserves 64 MiB of addresses for each further one.
/// Blocks above 256 KiB, a loaded table for one, go back to the system when they are freed.
void keep_memory_small() noexcept;

/// Locks the program, the C and C++ libraries, the heap, rings of samples and the calling thread's stack, all present from
/// now on. Other libraries: the touched part. Left out: stacks of other threads and the middleware's shared memory, where the
/// loop never goes. Call again now and then for later memory. 0, or the error of the system. Not on a running loop.
[[nodiscard]] int lock_memory();

/// Locks what came since the start, a model that was loaded for one, once a second.
class MemoryKeeper {
 public:
  explicit MemoryKeeper(const std::optional<config::RealtimeRequest>& request)
      : asked_{request && request->lock_memory} {}
  /// Why something is not locked, told once; empty: all is well. For the thread that looks after the process.
  [[nodiscard]] std::string look();

 private:
  bool asked_ = false, told_ = false;
  Instant due_;
};

}  // namespace invar
