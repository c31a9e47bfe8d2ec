// The executor by the clock: one thread that sleeps to absolute times.
#include <pthread.h>
#include <signal.h>
#include <time.h>

#include <algorithm>
#include <cerrno>

#include "core/base/clock.hpp"
#include "core/base/contract.hpp"
#include "core/base/fault.hpp"
#include "core/executor/executor.hpp"
#include "core/executor/slot.hpp"

namespace invar {

void Executor::start() {
  INVAR_EXPECTS(!options_.simulated && !thread_.joinable());
  prepare();
  stop_requested_ = false;
  std::promise<bool> ready;
  auto is_ready = ready.get_future();
  thread_ = std::thread{[this, &ready] { loop(ready); }};
  if (is_ready.get()) return;
  thread_.join();
  std::vector<Fault> faults;
  for (const Grant& g : grants_)
    if (!g.granted)
      faults.push_back({"process " + options_.process + ": " + g.setting,
                        g.what + " not granted (" + g.why + ")", g.mend + ", or declare `require: false`"});
  throw InputError{std::move(faults)};
}

void Executor::stop() {
  end_loop();
  const std::lock_guard turn{stepping_};
  deactivate_all(now());  // in simulated time, and before start()
}

void Executor::end_loop() {
  request_stop();
  if (thread_.joinable()) thread_.join();
  box_.deliver(true);
}

bool Executor::sleep_until(Instant due) noexcept {
  // A slow loop looks up now and then, so that it obeys and stops without waiting for its next cycle.
  constexpr Duration longest = Duration::milliseconds(20);
  for (;;) {
    const Instant current = monotonic_now();
    const bool last = due - current <= longest;
    const Instant until = last ? due : current + longest;
    const timespec t{until.ns / 1'000'000'000, until.ns % 1'000'000'000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
    }
    if (stop_requested_.load(std::memory_order_acquire)) {
      deactivate_all(utc_at(until));
      if (!winding_) return false;
    }
    if (last) return true;
    obey(utc_at(until));
  }
}

void Executor::loop(std::promise<bool>& ready) {
  const std::lock_guard turn{stepping_};
  sigset_t signals;
  sigfillset(&signals);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);  // handlers run on some other thread
  pthread_setname_np(pthread_self(), options_.process.substr(0, 15).c_str());
  if (options_.real_time) grants_ = claim_real_time(*options_.real_time);
  const bool refused = std::any_of(grants_.begin(), grants_.end(), [](const Grant& g) { return !g.granted; });
  if (refused && options_.real_time->require) {
    ready.set_value(false);
    return;
  }
  count_ = {};
  next_cycle_ = 0;
  count_.tripped = counters_.read().tripped;
  const std::int64_t period = options_.period.ns;
  const Instant first{(monotonic_now().ns / period + 2) * period};
  for (const auto& slot : slots_) {
    slot->next_due = 0;
    slot->active_since = std::max(slot->active_since, utc_at(first));
  }
  Pacer pacer{options_.period, options_.overrun, options_.tolerated, first};
  running_.store(true, std::memory_order_release);
  ready.set_value(true);

  constexpr Duration never{INT64_MAX};
  const Duration limit = options_.real_time ? options_.real_time->latency.value_or(never) : never;
  constexpr std::string_view too_late = "the loop lost a period, and its overrun policy is safe_stop";
  while (sleep_until(pacer.due())) {
    const Instant woke = monotonic_now();
    const Duration late = woke - pacer.due();
    if (const std::uint64_t gone = pacer.wake(woke); gone > 0) {
      stall_end_ = utc_at(pacer.due());
      stall_ = options_.period * static_cast<std::int64_t>(gone * pacer.stretch());
    }
    const Instant start = utc_at(pacer.due());
    if (pacer.take_stop()) stop_safely(too_late, start);
    run_cycle(start, pacer.cycle(), pacer.stretch());
    const Instant done = monotonic_now();
    pacer.finish(done);
    if (pacer.take_stop()) stop_safely(too_late, start);
    wake_up_.add(late);
    compute_.add(done - woke);
    latency_.add(late + (done - woke));
    const bool is_late = late + (done - woke) > limit;
    if (is_late) ++count_.late;
    if (options_.late == LatePolicy::safe_stop && (is_late || late_input_))
      stop_safely(is_late ? "a cycle ended later than its declared latency"
                          : "an input's sample is older than its declared latency",
                  start);
    late_input_ = false;
    count_.overruns = pacer.overruns();
    count_.skipped = pacer.skipped();
    count_.stretch = pacer.stretch();
    close_cycle(start, late, done - woke);
    if (cycle_ended_) cycle_ended_();
  }
  running_.store(false, std::memory_order_release);
}

}  // namespace invar
