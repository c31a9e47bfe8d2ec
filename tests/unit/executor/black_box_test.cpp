#include "core/executor/black_box.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <thread>

#include "tests/unit/executor/toys.hpp"

namespace invar {
namespace {

using namespace toys;

TEST(BlackBox, KeepsTheLastCyclesAndAFewAfterTheTripWithTheSignalsOfEach) {
  ExecutorOptions options = simulated();
  options.black_box = 16;
  Loop loop{options};
  std::vector<BlackBoxRecord> records;
  loop.executor.black_box().watch("force", "N", [&] { return loop.listener->last.value; });
  loop.executor.black_box().watch("cycle", "1", [&] { return static_cast<double>(loop.servo->steps); });
  loop.executor.black_box().on_trip([&](const BlackBoxRecord& record) { records.push_back(record); });
  loop.bring_up();
  loop.servo->fail_at = 100;
  loop.executor.advance_to({200'000'000});

  ASSERT_EQ(records.size(), 1U);
  const BlackBoxRecord& record = records.front();
  EXPECT_EQ(record.process, "test");
  EXPECT_EQ(record.reason, "servo: following error too large");
  EXPECT_EQ(record.tripped_cycle, 100U);
  EXPECT_EQ(record.tripped_at.ns, 100'000'000);
  EXPECT_THAT(record.components, testing::ElementsAre("plant", "servo", "listener"));
  ASSERT_EQ(record.signals.size(), 2U);
  EXPECT_EQ(record.signals[0].unit, "N");
  ASSERT_EQ(record.cycles.size(), 16U);
  ASSERT_EQ(record.samples.size(), 32U);
  for (std::size_t i = 0; i < 16; ++i) {
    const CycleRecord& cycle = record.cycles[i];
    EXPECT_EQ(cycle.cycle, 87 + i);  // 13 before the trip, itself, 2 after
    EXPECT_EQ(cycle.due.ns, static_cast<std::int64_t>(cycle.cycle) * 1'000'000);
    EXPECT_EQ(cycle.states[1], cycle.cycle < 100 ? LifecycleState::active : LifecycleState::error);
    EXPECT_EQ(cycle.states[0], LifecycleState::active);
    EXPECT_EQ(record.samples[2 * i + 1], static_cast<double>(std::min<std::uint64_t>(cycle.cycle, 100) + 1));
  }
}

TEST(BlackBox, IsArmedAgainAfterItWasHandedOver) {
  Loop loop{simulated()};
  std::vector<std::string> reasons;
  loop.executor.black_box().on_trip([&](const BlackBoxRecord& record) { reasons.push_back(record.reason); });
  loop.bring_up();
  loop.executor.advance_to({10'000'000});
  loop.executor.freeze_black_box();
  loop.executor.advance_to({500'000'000});
  loop.executor.trip("door opened");
  loop.executor.advance_to({1'000'000'000});
  EXPECT_THAT(reasons, testing::ElementsAre("asked for", "door opened"));
}

TEST(BlackBox, ComesFromAnotherThreadThanTheLoopAndAtTheLatestWhenTheLoopEnds) {
  for (const bool early : {true, false}) {
    ExecutorOptions options;
    options.black_box = early ? 64 : 1'000'000;  // an eighth of a million cycles after the trip never comes
    std::thread::id loop_thread, callback_thread;
    std::atomic<int> records{0};
    Executor executor{options};
    executor.add(std::make_unique<Call>([&](const Tick&) { loop_thread = std::this_thread::get_id(); }));
    executor.black_box().on_trip([&](const BlackBoxRecord& record) {
      EXPECT_FALSE(record.cycles.empty());
      callback_thread = std::this_thread::get_id();
      ++records;
    });
    (void)executor.transition(0, Transition::configure);
    (void)executor.transition(0, Transition::activate);
    executor.start();
    while (executor.steps(0) < 10) std::this_thread::sleep_for(std::chrono::milliseconds{1});
    executor.freeze_black_box();
    while (early && records == 0) std::this_thread::sleep_for(std::chrono::milliseconds{1});
    while (executor.steps(0) < 20) std::this_thread::sleep_for(std::chrono::milliseconds{1});
    executor.stop();
    EXPECT_EQ(records, 1);
    EXPECT_NE(callback_thread, loop_thread);
  }
}

}  // namespace
}  // namespace invar
