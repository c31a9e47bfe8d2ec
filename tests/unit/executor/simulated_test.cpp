// The executor in simulated time: repeatable, failing safely, obeying between two steps.
#include <gmock/gmock.h>

#include "tests/unit/executor/toys.hpp"

namespace invar {
namespace {

using namespace toys;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr Instant at_ms(std::int64_t ms) { return {ms * 1'000'000}; }

std::uint64_t hash_of_a_run(std::int64_t grant_ns, std::uint32_t listen_every = 1) {
  Loop loop{simulated(), listen_every};
  loop.bring_up();
  loop.servo->setpoint = 0.05;
  for (Instant t{0}; t < at_ms(2000);) {
    t = std::min(t + Duration{grant_ns}, at_ms(2000));
    loop.executor.advance_to(t);
  }
  EXPECT_EQ(loop.executor.counters().executed, 2000U);
  EXPECT_EQ(loop.servo->steps, 2000U);
  return loop.listener->hash;
}

TEST(SimulatedTime, TwoRunsAgreeBitForBitWhateverTheSizeOfTheGrants) {
  const std::uint64_t whole = hash_of_a_run(2'000'000'000);
  EXPECT_EQ(hash_of_a_run(2'000'000'000), whole);
  EXPECT_EQ(hash_of_a_run(1'000'000), whole);
  EXPECT_EQ(hash_of_a_run(333'333), whole);
  EXPECT_EQ(hash_of_a_run(7'654'321), whole);
  EXPECT_NE(hash_of_a_run(2'000'000'000, 3), whole) << "the hash sees a change";
}

TEST(SimulatedTime, BeginsAtZeroAndRunsTheCyclesThatBeginBeforeTheGrantEnds) {
  std::vector<std::pair<std::uint64_t, std::int64_t>> seen;
  Executor executor{simulated()};
  executor.add(std::make_unique<Call>([&](const Tick& t) { seen.emplace_back(t.cycle, t.now.ns); }));
  (void)executor.transition(0, Transition::configure);
  (void)executor.transition(0, Transition::activate);
  executor.advance_to({0});
  EXPECT_TRUE(seen.empty());
  executor.advance_to({1});
  EXPECT_THAT(seen, ElementsAre(std::pair{0U, 0}));
  executor.advance_to({1'000'000});
  EXPECT_EQ(seen.size(), 1U);
  executor.advance_to({2'000'001});
  EXPECT_THAT(seen, ElementsAre(std::pair{0U, 0}, std::pair{1U, 1'000'000}, std::pair{2U, 2'000'000}));
  EXPECT_EQ(executor.now().ns, 2'000'001);
}

TEST(Executor, StepsADividedComponentOnMultiplesOfItsDividerWithItsOwnPeriod) {
  std::vector<std::uint64_t> cycles;
  double period = 0.0;
  Executor executor{simulated()};
  executor.add(std::make_unique<Call>([&](const Tick& t) {
                 cycles.push_back(t.cycle);
                 period = t.period;
               }),
               {"call", {}, nullptr, 4});
  (void)executor.transition(0, Transition::configure);
  executor.advance_to(at_ms(5));
  (void)executor.transition(0, Transition::activate);
  executor.advance_to(at_ms(17));
  EXPECT_THAT(cycles, ElementsAre(8U, 12U, 16U));
  EXPECT_DOUBLE_EQ(period, 4e-3);
}

TEST(Executor, AFailedComponentGoesToErrorWithItsSafeValueAndTheOthersCarryOn) {
  Loop loop{simulated()};
  loop.bring_up();
  loop.servo->fail_at = 10;
  loop.executor.advance_to(at_ms(10));
  loop.servo->setpoint = 1.0;
  EXPECT_EQ(loop.executor.state(1), LifecycleState::active);
  loop.executor.advance_to(at_ms(12));
  EXPECT_EQ(loop.executor.state(1), LifecycleState::error);
  EXPECT_EQ(loop.executor.failure(1), "following error too large");
  EXPECT_EQ(loop.plant->force.latest()->value, 0.0);
  EXPECT_EQ(loop.executor.state(0), LifecycleState::active);
  EXPECT_EQ(loop.servo->steps, 11U);

  EXPECT_EQ(loop.executor.transition(1, Transition::activate).verdict, Verdict::refused);
  loop.servo->fail_at = 0;
  EXPECT_EQ(loop.executor.transition(1, Transition::reset).state, LifecycleState::unconfigured);
  EXPECT_EQ(loop.servo->cleaned, 1);
  EXPECT_TRUE(loop.executor.transition(1, Transition::configure).ok());
  EXPECT_TRUE(loop.executor.transition(1, Transition::activate).ok());
  loop.executor.advance_to(at_ms(20));
  EXPECT_EQ(loop.executor.state(1), LifecycleState::active);
}

TEST(Executor, AMissedInputDeadlineIsAnErrorUnlessTheComponentDealsWithIt) {
  for (const bool controls : {false, true}) {
    Loop loop{simulated()};
    loop.bring_up();
    loop.servo->controls_loss = controls;
    loop.executor.advance_to(at_ms(10));
    ASSERT_TRUE(loop.executor.transition(0, Transition::deactivate).ok());
    loop.executor.advance_to(at_ms(13));  // last sample at 9 ms, deadline 3 ms: cycles 10..12 are in time
    EXPECT_EQ(loop.servo->lost, 0);
    EXPECT_EQ(loop.executor.state(1), LifecycleState::active);
    loop.executor.advance_to(at_ms(15));
    EXPECT_EQ(loop.servo->lost, controls ? 2 : 1);
    EXPECT_EQ(loop.executor.state(1), controls ? LifecycleState::active : LifecycleState::error);
    EXPECT_EQ(loop.servo->steps, controls ? 15U : 13U);
    EXPECT_EQ(loop.executor.failure(1),
              controls ? "" : "input `position` lost: nothing came within its deadline of 3 ms");
  }
}

TEST(Executor, AnInputThatNeverCameIsMissedFromActivationOn) {
  Loop loop{simulated()};
  (void)loop.executor.transition(1, Transition::configure);
  loop.executor.advance_to(at_ms(100));
  (void)loop.executor.transition(1, Transition::activate);
  loop.executor.advance_to(at_ms(103));
  EXPECT_EQ(loop.executor.state(1), LifecycleState::active);
  loop.executor.advance_to(at_ms(105));
  EXPECT_EQ(loop.executor.state(1), LifecycleState::error);
}

TEST(Executor, RefusesAnActivationThatWouldJump) {
  Loop loop{simulated()};
  loop.bring_up();
  loop.executor.advance_to(at_ms(50));
  EXPECT_EQ(loop.executor.state(1), LifecycleState::active);
  EXPECT_TRUE(loop.executor.transition(1, Transition::deactivate).ok());
  loop.servo->jump = 1e-3;
  const Outcome outcome = loop.executor.transition(1, Transition::activate);
  EXPECT_EQ(outcome.verdict, Verdict::failed);
  EXPECT_THAT(outcome.reason, HasSubstr("would jump"));
  EXPECT_EQ(loop.executor.state(1), LifecycleState::error);
}

TEST(Executor, ChecksTheJumpAfterTheFirstStepWhenNothingWasMeasuredBefore) {
  Loop loop{simulated()};
  loop.servo->jump = 1e-3;
  loop.bring_up();
  EXPECT_EQ(loop.executor.state(1), LifecycleState::active);
  loop.executor.advance_to(at_ms(2));
  EXPECT_EQ(loop.executor.state(1), LifecycleState::error);
  EXPECT_EQ(loop.plant->force.latest()->value, 0.0);
}

TEST(Executor, KeepsTheReasonOfAConfigureThatThrew) {
  Loop loop{simulated()};
  loop.servo->refuse_to_configure = true;
  const Outcome outcome = loop.executor.transition(1, Transition::configure);
  EXPECT_EQ(outcome.verdict, Verdict::failed);
  EXPECT_EQ(outcome.reason, "no such device");
  EXPECT_EQ(loop.executor.state(1), LifecycleState::error);
  EXPECT_EQ(loop.executor.failure(1), "no such device");
}

TEST(Executor, ATripDeactivatesDownstreamFirstAndBlocksActivationUntilCleared) {
  Loop loop{simulated()};
  loop.bring_up();
  loop.executor.advance_to(at_ms(10));
  StateChange change;
  while (loop.executor.take_change(change)) {
  }
  loop.executor.trip("door opened");
  loop.executor.advance_to(at_ms(11));
  std::vector<std::uint32_t> order;
  while (loop.executor.take_change(change)) order.push_back(change.component);
  EXPECT_THAT(order, ElementsAre(2U, 1U, 0U));
  EXPECT_EQ(loop.plant->force.latest()->value, 0.0);
  EXPECT_EQ(loop.executor.trip_reason(), "door opened");
  EXPECT_TRUE(loop.executor.counters().tripped);
  EXPECT_THAT(loop.executor.transition(0, Transition::activate).reason, HasSubstr("door opened"));
  loop.executor.clear_trip();
  EXPECT_TRUE(loop.executor.transition(0, Transition::activate).ok());
}

struct Obedient final : Component {
  Inbox<Sample> orders{*this, "orders"};
  std::vector<std::uint64_t> obeyed;
  void step(const Tick&) noexcept override {
    for (Sample order; orders.take(order);) obeyed.push_back(order.cycle);
  }
};

TEST(Executor, AComponentDoesNotObeyWhatItWasToldWhileItWasNotActive) {
  Executor executor{simulated()};
  auto owned = std::make_unique<Obedient>();
  Obedient& component = *owned;
  const auto tell = component.orders.add_lane();
  executor.add(std::move(owned), {"obedient", {}, nullptr, 1});
  tell({1, 0.0}, at_ms(0));
  (void)executor.transition(0, Transition::configure);
  tell({2, 0.0}, at_ms(0));
  ASSERT_TRUE(executor.transition(0, Transition::activate).ok());
  tell({3, 0.0}, at_ms(0));
  executor.advance_to(at_ms(5));
  (void)executor.transition(0, Transition::deactivate);
  tell({4, 0.0}, at_ms(5));
  executor.advance_to(at_ms(10));
  ASSERT_TRUE(executor.transition(0, Transition::activate).ok());
  executor.advance_to(at_ms(15));
  EXPECT_THAT(component.obeyed, ElementsAre(3U));
}

struct Fuse final : Component {
  bool blown = true;
  void step(const Tick&) noexcept override {}
  [[nodiscard]] bool has_latch() const noexcept override { return true; }
  void reset_latch() noexcept override { blown = false; }
};

TEST(Executor, ALatchIsResetWhileItsComponentIsActiveAndOneWithoutALatchRefuses) {
  Executor executor{simulated()};
  auto owned = std::make_unique<Fuse>();
  const Fuse& fuse = *owned;
  executor.add(std::move(owned), {"fuse", {}, nullptr, 1});
  executor.add(std::make_unique<Obedient>(), {"obedient", {}, nullptr, 1});
  for (const std::size_t each : {0U, 1U})
    for (const Transition transition : {Transition::configure, Transition::activate})
      ASSERT_TRUE(executor.transition(each, transition).ok());
  const Outcome outcome = executor.transition(0, Transition::reset);
  EXPECT_EQ(outcome.verdict, Verdict::done) << outcome.reason;
  EXPECT_EQ(outcome.state, LifecycleState::active);
  EXPECT_FALSE(fuse.blown);
  EXPECT_EQ(executor.transition(1, Transition::reset).verdict, Verdict::refused);
}

TEST(Executor, WhatMovesIsSteppedUntilItRestsAndKeepsWhatItReads) {
  Track track{simulated()};
  track.executor.advance_to(at_ms(10));
  track.executor.trip("door opened");
  track.executor.advance_to(at_ms(11));
  EXPECT_EQ(track.states(), "aa-");
  EXPECT_TRUE(track.executor.counters().tripped);
  track.executor.advance_to(at_ms(30));
  EXPECT_EQ(track.states(), "aa-");
  EXPECT_EQ(track.runner->speed, 0);
  track.executor.advance_to(at_ms(31));
  EXPECT_EQ(track.states(), "---");
  EXPECT_EQ(track.executor.steps(1), 30U);
}

TEST(Executor, WhatDoesNotComeToRestIsLetGoInTime) {
  ExecutorOptions options = simulated();
  options.wind_down = Duration::milliseconds(50);
  Track track{options};
  track.runner->speed = 1'000'000;
  track.executor.advance_to(at_ms(10));
  track.executor.trip("door opened");
  track.executor.advance_to(at_ms(60));
  EXPECT_EQ(track.states(), "aa-");
  track.executor.advance_to(at_ms(61));
  EXPECT_EQ(track.states(), "---");
  std::vector<std::string> told;
  for (StateChange change; track.executor.take_change(change);)
    if (change.to == LifecycleState::inactive && change.why[0] != 0)
      told.push_back(std::to_string(change.component) + ": " + change.why.data());
  EXPECT_THAT(told, ElementsAre(HasSubstr("1: it was deactivated while it still moved")));
}

TEST(Executor, AllThatMovesCanBeBroughtToRestWhileEverythingGoesOn) {
  Track track{simulated()};
  track.executor.advance_to(at_ms(10));
  EXPECT_TRUE(track.executor.is_at_rest());  // nobody was asked
  track.executor.wind_down_all();
  for (int ms = 10; ms < 30; ++ms) {
    EXPECT_FALSE(track.executor.is_at_rest()) << ms;
    track.executor.advance_to(at_ms(ms + 1));
  }
  track.executor.advance_to(at_ms(31));
  EXPECT_TRUE(track.executor.is_at_rest());
  track.executor.advance_to(at_ms(100));
  EXPECT_EQ(track.states(), "aaa");
  EXPECT_EQ(track.runner->speed, 0);
  EXPECT_TRUE(track.executor.transition(1, Transition::deactivate).ok());
  for (StateChange change; track.executor.take_change(change);)
    EXPECT_TRUE(change.to == LifecycleState::active || change.why[0] == 0);
}

TEST(Executor, NobodyIsWaitedForWhenNobodySteps) {
  Track track{simulated()};
  track.executor.advance_to(at_ms(10));
  EXPECT_EQ(track.executor.transition(1, Transition::deactivate).verdict, Verdict::done);
  EXPECT_EQ(track.executor.steps(1), 10U);
  EXPECT_TRUE(track.executor.transition(1, Transition::activate).ok());
  track.executor.stop();
  EXPECT_EQ(track.states(), "---");
}

TEST(Executor, AppliesAParameterBetweenTwoStepsAndSaysWhyNot) {
  Loop loop{simulated()};
  loop.bring_up();
  loop.executor.advance_to(at_ms(5));
  EXPECT_EQ(loop.executor.set_parameter(1, "gain", 200.0), "");
  EXPECT_EQ(loop.servo->changes, 1);
  EXPECT_DOUBLE_EQ(*loop.executor.parameter(1, "gain"), 200.0);
  EXPECT_EQ(loop.executor.set_parameter(1, "gain", 2000.0),
            "servo.gain: 2000 1/s2 is outside 0 .. 1000 1/s2");
  EXPECT_THAT(loop.executor.set_parameter(1, "gain", std::nan("")), HasSubstr("is outside"));
  EXPECT_THAT(loop.executor.set_parameter(1, "window", 2.0), HasSubstr("may not change while running"));
  EXPECT_THAT(loop.executor.set_parameter(1, "gains", 2.0), HasSubstr("did you mean `gain`?"));
  EXPECT_DOUBLE_EQ(*loop.executor.parameter(1, "gain"), 200.0);
  EXPECT_EQ(loop.servo->changes, 1);
}

}  // namespace
}  // namespace invar
