#include "tests/support/real_time_guard.hpp"

#include <dlfcn.h>
#include <linux/filter.h>
#include <linux/futex.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <semaphore.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdlib>

namespace {

// Plain thread-local words: they need no constructor, so that the first malloc of a thread may count already.
thread_local std::uint64_t allocations = 0;
thread_local std::uint64_t locks = 0;

/// The function of the same name behind this one; looked up without allocating in the common case.
template <class Function>
Function next(Function& cached, const char* name) {
  if (cached == nullptr) cached = reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
  return cached;
}

}  // namespace

// The thread sanitizer has calls of these names itself, which must see each lock and each block of memory, and it is not ready yet
// when the first ones come. Nothing is counted under it.
#ifndef __SANITIZE_THREAD__

// The C library's own names for what stands behind malloc.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* memory);

void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* old, std::size_t size) {
  ++allocations;
  return __libc_realloc(old, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  ++allocations;
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? ENOMEM : 0;
}
void free(void* memory) {
  if (memory != nullptr) ++allocations;
  __libc_free(memory);
}

#define INVAR_COUNT_LOCK(name, parameters, arguments) \
  int name parameters {                               \
    static int(*behind) parameters = nullptr;         \
    ++locks;                                          \
    return next(behind, #name) arguments;             \
  }

INVAR_COUNT_LOCK(pthread_mutex_lock, (pthread_mutex_t * mutex), (mutex))
INVAR_COUNT_LOCK(pthread_mutex_trylock, (pthread_mutex_t * mutex), (mutex))
INVAR_COUNT_LOCK(pthread_mutex_timedlock, (pthread_mutex_t * mutex, const timespec* until), (mutex, until))
INVAR_COUNT_LOCK(pthread_rwlock_rdlock, (pthread_rwlock_t * lock), (lock))
INVAR_COUNT_LOCK(pthread_rwlock_wrlock, (pthread_rwlock_t * lock), (lock))
INVAR_COUNT_LOCK(pthread_spin_lock, (pthread_spinlock_t * lock), (lock))
INVAR_COUNT_LOCK(pthread_cond_signal, (pthread_cond_t * condition), (condition))
INVAR_COUNT_LOCK(pthread_cond_broadcast, (pthread_cond_t * condition), (condition))
INVAR_COUNT_LOCK(sem_wait, (sem_t * semaphore), (semaphore))
INVAR_COUNT_LOCK(sem_post, (sem_t * semaphore), (semaphore))
}

#endif

namespace invar::support {

ThreadCounts thread_counts() noexcept { return {allocations, locks}; }

bool forbid_system_calls(Waking waking) noexcept {
  const auto load = [](std::size_t offset) {
    return sock_filter BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset));
  };
  const auto unless = [](unsigned value, std::uint8_t skipped) {
    return sock_filter BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, skipped);
  };
  const sock_filter allow BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
  const sock_filter kill BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS);
  constexpr unsigned none = ~0U;  // the number of no system call
  // The second argument of a futex call says what it does.
  std::array<sock_filter, 10> program{
      {load(offsetof(seccomp_data, nr)), unless(SYS_clock_nanosleep, 1), allow, unless(SYS_clock_gettime, 1),
       allow,  // usually no system call at all
       unless(waking == Waking::allowed ? SYS_futex : none, 3),
       load(offsetof(seccomp_data, args) + sizeof(std::uint64_t)), unless(FUTEX_WAKE, 1), allow, kill}};
  sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

}  // namespace invar::support
