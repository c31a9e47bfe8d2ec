#include "core/executor/real_time.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>

#include <cerrno>
#include <cstring>

#include "core/executor/locked_memory.hpp"

namespace invar {

namespace {

Grant grant(std::string what, std::string setting, int error, std::string mend) {
  Grant g{std::move(what), std::move(setting), error == 0, "", ""};
  if (!g.granted) {
    g.why = std::strerror(error);
    g.mend = std::move(mend);
  }
  return g;
}

}  // namespace

void touch_stack(std::size_t bytes) noexcept {
  constexpr std::size_t step = 64 * 1024;
  std::array<char, step> room;
  volatile char* page = room.data();
  for (std::size_t i = 0; i < step; i += 1024) page[i] = 0;
  if (bytes > step) touch_stack(bytes - step);
  page[0] = 1;  // after the call: keeps the frames below each other
}

std::vector<Grant> claim_real_time(const RealTimeRequest& request) {
  std::vector<Grant> grants;
  if (request.lock_memory) {
    grants.push_back(
        grant("memory locked", "realtime.lock_memory", lock_memory(),
              "run as root, or raise `memlock` in /etc/security/limits.conf (LimitMEMLOCK in systemd)"));
  }
  if (request.cpu) {
    cpu_set_t cores;
    CPU_ZERO(&cores);
    CPU_SET(static_cast<std::size_t>(*request.cpu), &cores);
    const int error = pthread_setaffinity_np(pthread_self(), sizeof cores, &cores);
    grants.push_back(grant("core " + std::to_string(*request.cpu), "realtime.cpu", error,
                           "name a core this machine has and this process may use"));
  }
  if (request.priority > 0) {
    sched_param parameters{};
    parameters.sched_priority = request.priority;
    const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
    grants.push_back(
        grant("SCHED_FIFO priority " + std::to_string(request.priority), "realtime.priority", error,
              "run as root, or raise `rtprio` in /etc/security/limits.conf (LimitRTPRIO in systemd)"));
  }
  // Without SCHED_FIFO the kernel may otherwise be 50 us late on purpose.
  const int error = prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL) == 0 ? 0 : errno;
  grants.push_back(grant("timer slack 1 ns", "realtime", error, "allow the system call prctl"));
  touch_stack();
  return grants;
}

std::vector<std::string> refusals(const std::vector<Grant>& grants) {
  std::vector<std::string> lines;
  for (const Grant& g : grants)
    if (!g.granted) lines.push_back(g.setting + ": " + g.what + " not granted (" + g.why + "); " + g.mend);
  return lines;
}

}  // namespace invar
