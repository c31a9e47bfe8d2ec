// The loop neither allocates nor locks nor makes any system call but the one that sleeps; also while others look
// at it, change its parameters and record. Each claim is made by a check that is shown to fail.
#include <gmock/gmock.h>
#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <chrono>
#include <climits>
#include <csignal>
#include <cstdio>
#include <mutex>
#include <thread>

#include "core/executor/process_control.hpp"
#include "tests/support/real_time_guard.hpp"
#include "tests/unit/executor/toys.hpp"

namespace invar {
namespace {

using namespace toys;
using support::thread_counts;
using support::ThreadCounts;

constexpr std::uint64_t warm = 50;      // steps
constexpr std::uint64_t enough = 1500;  // steps

// Called directly, `operator new` may not be optimised away, as a new-expression may.

/// What one run saw on the loop's thread, from the warm-up's end on.
struct Seen {
  std::uint64_t allocations = 0, locks = 0;
  std::atomic<bool> done{false};
};

/// Steps a servo loop with a first component that counts, or forbids, and `misbehaves` besides.
struct Stand {
  explicit Stand(bool forbid, std::function<void()> misbehave = {},
                 support::Waking waking = support::Waking::forbidden)
      : loop{options()} {
    auto probe = std::make_unique<Call>([this, forbid, misbehave, waking, step = std::uint64_t{0},
                                         before = ThreadCounts{}](const Tick&) mutable {
      ++step;
      if (step == warm) {
        before = thread_counts();
        if (forbid && !support::forbid_system_calls(waking)) std::_Exit(3);
      }
      if (step == warm + 10 && misbehave) misbehave();
      if (step == enough) {
        seen.allocations = thread_counts().allocations - before.allocations;
        seen.locks = thread_counts().locks - before.locks;
        seen.done = true;
      }
    });
    probe->name = "probe";
    loop.executor.add(std::move(probe));
    loop.executor.black_box().watch("measured", "m", [this] { return loop.servo->measured; });
    loop.executor.black_box().on_trip([this](const BlackBoxRecord&) { ++records; });
  }
  static ExecutorOptions options() {
    ExecutorOptions o;
    o.process = "guarded";
    o.period = Duration::microseconds(500);
    o.black_box = 64;
    return o;
  }

  /// Until the probe is done; false when it did not come so far. All the while this thread looks, sets, trips.
  bool run(bool hammer) {
    loop.bring_up();
    (void)loop.executor.transition(3, Transition::configure);
    (void)loop.executor.transition(3, Transition::activate);
    loop.executor.start();
    ProcessControl control{loop.executor};
    std::size_t looks = 0;
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds{60};
    while (!seen.done && std::chrono::steady_clock::now() < until) {
      if (!hammer) {
        std::this_thread::sleep_for(std::chrono::milliseconds{1});
        continue;
      }
      looks += control.status().components.size();
      StateChange change;
      while (loop.executor.take_change(change)) ++looks;
      const double gain = 50.0 + static_cast<double>(looks % 100);
      EXPECT_EQ(control.set_parameter("servo", "gain", gain), "");
      EXPECT_TRUE(
          control.request("listener", looks % 2 == 0 ? Transition::deactivate : Transition::activate).ok());
      control.freeze_black_box();
      if (looks % 64 == 0) control.clear_statistics();
    }
    return seen.done;
  }

  Seen seen;
  std::atomic<int> records{0};
  Loop loop;
};

TEST(RealTimeGuard, SeesAllocationsAndLocksOfItsThreadOnly) {
  const support::RealTimeGuard guard;
  EXPECT_EQ(guard.violations(), 0U);
  std::mutex mutex;
  std::thread other{[&] {
    const std::lock_guard lock{mutex};
    ::operator delete(::operator new(8));
  }};
  other.join();
  const std::uint64_t own = guard.allocations();  // the thread object is ours
  ::operator delete(::operator new(8));
  EXPECT_EQ(guard.allocations(), own + 2);
  const std::uint64_t locks = guard.locks();
  mutex.lock();
  mutex.unlock();
  EXPECT_EQ(guard.locks(), locks + 1);
}

TEST(RealTime, TheLoopNeitherAllocatesNorLocksWhileOthersLookSetAndRecord) {
  for (const bool hammer : {false, true}) {
    Stand stand{false};
    ASSERT_TRUE(stand.run(hammer));
    EXPECT_EQ(stand.seen.allocations, 0U) << (hammer ? "hammered" : "alone");
    EXPECT_EQ(stand.seen.locks, 0U) << (hammer ? "hammered" : "alone");
    stand.loop.executor.stop();
    EXPECT_EQ(stand.records > 0, hammer) << "the black box is handed over meanwhile";
  }
}

TEST(RealTime, TheCheckSeesAComponentThatAllocatesOrLocks) {
  Stand allocates{false, [] { ::operator delete(::operator new(8)); }};
  ASSERT_TRUE(allocates.run(false));
  EXPECT_EQ(allocates.seen.allocations, 2U);
  std::mutex mutex;
  Stand locks{false, [&] { const std::lock_guard lock{mutex}; }};
  ASSERT_TRUE(locks.run(false));
  EXPECT_EQ(locks.seen.locks, 1U);
}

/// In a child process, because there is no way back from the filter.
[[noreturn]] void run_forbidden(bool hammer, std::function<void()> misbehave) {
  Stand stand{true, std::move(misbehave)};
  const bool done = stand.run(hammer);
  std::_Exit(done ? 0 : 4);
}

TEST(RealTimeDeathTest, TheLoopMakesNoSystemCallButTheOneThatSleeps) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(run_forbidden(false, {}), testing::ExitedWithCode(0), "");
}

TEST(RealTimeDeathTest, NorDoesItWhileOthersLookSetAndRecord) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(run_forbidden(true, {}), testing::ExitedWithCode(0), "");
}

/// A loop that wakes a thread of another at the end of each cycle, as it does where another process waits for its samples.
[[noreturn]] void run_waking(support::Waking waking) {
  Stand stand{true, {}, waking};
  std::atomic<std::uint32_t> word{0};
  stand.loop.executor.at_cycle_end(
      [&word] { syscall(SYS_futex, &word, FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0); });
  std::_Exit(stand.run(false) ? 0 : 4);
}

TEST(RealTimeDeathTest, AtTheEndOfACycleItMayWakeOthersAndDoNothingElse) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(run_waking(support::Waking::allowed), testing::ExitedWithCode(0), "");
  EXPECT_EXIT(run_waking(support::Waking::forbidden), testing::KilledBySignal(SIGSYS), "");
}

TEST(RealTimeDeathTest, TheFilterKillsALoopWhoseComponentMakesASystemCall) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(run_forbidden(false, [] { (void)getppid(); }), testing::KilledBySignal(SIGSYS), "");
  EXPECT_EXIT(run_forbidden(false, [] { std::this_thread::yield(); }), testing::KilledBySignal(SIGSYS), "");
}

}  // namespace
}  // namespace invar
