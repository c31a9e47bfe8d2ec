// Two components and the link between them, step by step: who commands, and from which state.
#include <gmock/gmock.h>

#include <limits>
#include <string>
#include <vector>

#include "core/component/standby.hpp"
#include "tests/support/real_time_guard.hpp"

namespace invar {
namespace {

constexpr Duration period = Duration::milliseconds(1);
enum class Mode : std::uint8_t { off, on, fault };

/// Counts up once a step: a jump or a repetition shows in what it commands.
class Counter final : public Component, public Redundant {
 public:
  Counter() { id = 7; }
  [[nodiscard]] Standby& standby() noexcept override { return standby_; }
  template <class W>
  void warm(W& w) noexcept {
    w(count, "count", Range{0.0, 1e6});
    w(flag, "flag");
    w(mode, "mode", Mode::fault);
    w(number, "number");
    w(began, "began");
    if (has_more) w(flag, "more");
  }
  void activate() override { standby_.activate(); }
  void deactivate() noexcept override { standby_.resign(); }
  void step(const Tick& tick) noexcept override {
    commanded.reset();
    standby_.fit(reaches);
    const auto duty = standby_.look(tick);
    if (duty == Standby::Duty::lead && standby_.is_in_doubt(tick) && !reaches) standby_.yield();
    if (duty == Standby::Duty::missing && device_is_free) standby_.take_over(*this);
    if (duty == Standby::Duty::missing && !device_is_free && !standby_.is_certain())
      standby_.wait_for_device(", but the device is commanded");
    else if (duty == Standby::Duty::missing && !device_is_free)
      standby_.take_over(*this);
    if (duty == Standby::Duty::stand_by || !standby_.leads()) return standby_.tell();
    commanded = ++count;
    standby_.tell(*this);
  }

  double count = 0.0;
  bool flag = false, has_more = false, device_is_free = true, reaches = true;
  Mode mode = Mode::off;
  std::uint64_t number = 0;
  Instant began;
  std::optional<double> commanded;

 private:
  Notices notices_{*this};
  Standby standby_{*this, notices_};
};

struct Pair {
  Counter first, spare;
  bool linked = true, two_may_command = false;
  Instant now{1'700'000'000'000'000'000};
  std::uint64_t cycle = 0;
  std::vector<std::string> said;
  std::vector<standby::WarmState> spoilt;  // sent in place of the next beats of the first

  Pair() {
    first.name = "first";
    spare.name = "spare";
    first.standby().pair({.other = "`spare`",
                          .command = "",
                          .is_spare = false,
                          .deadline = Duration::milliseconds(10),
                          .process = 1});
    spare.standby().pair({.other = "`first`",
                          .command = "",
                          .is_spare = true,
                          .deadline = Duration::milliseconds(10),
                          .process = 2});
    join(first, spare);
    join(spare, first);
    for (Counter* each : {&first, &spare}) {
      dynamic_cast<Output<event::Notice>&>(*each->find_port("notices"))
          .add_sink([this, each](const event::Notice& notice, Instant) {
            said.push_back(each->name + ": " + notice.text().c_str());
          });
      each->set_now(now);
      each->activate();
    }
  }
  void join(Counter& from, Counter& to) {
    auto* input = dynamic_cast<Input<standby::WarmState>*>(to.find_port("other"));
    dynamic_cast<Output<standby::WarmState>&>(*from.find_port("warm"))
        .add_sink([this, input, &from](const standby::WarmState& beat, Instant) {
          if (!linked) return;
          input->accept(&from == &first && !spoilt.empty() ? spoilt.back() : beat, now);
        });
  }
  /// Steps those that run; the first before the spare.
  void step(bool first_runs = true, bool spare_runs = true) {
    now += period;
    ++cycle;
    first.commanded.reset();
    spare.commanded.reset();
    for (auto [component, runs] : {std::pair{&first, first_runs}, std::pair{&spare, spare_runs}}) {
      if (!runs) continue;
      component->set_now(now, cycle);
      component->step({now, period.in_seconds(), cycle});
    }
    EXPECT_FALSE(linked && !two_may_command && first.commanded && spare.commanded && cycle > 3)
        << "two masters in cycle " << cycle;
  }
  void steps(int count, bool first_runs = true, bool spare_runs = true) {
    for (int i = 0; i < count; ++i) step(first_runs, spare_runs);
  }
  void begin() {
    steps(20);
    ASSERT_TRUE(first.commanded);
    ASSERT_FALSE(spare.commanded);
  }
  void restart(Counter& component) {
    component.count = 0.0;
    component.set_now(now, cycle);
    component.activate();
  }
};

TEST(Standby, WhereNobodyStandsByAComponentLeads) {
  Counter alone;
  alone.activate();
  alone.step({Instant{}, 0.001, 0});
  EXPECT_TRUE(alone.commanded);
  EXPECT_STREQ(alone.standby().role(), "");
}

TEST(Standby, TheOneThatTheFileNamesFirstLeads) {
  Pair pair;
  pair.begin();
  EXPECT_STREQ(pair.first.standby().role(), "active");
  EXPECT_STREQ(pair.spare.standby().role(), "standby");
  EXPECT_THAT(pair.said, testing::IsEmpty()) << "an ordinary start is no news";
}

TEST(Standby, TakesOverAfterTheDeadlineAndGoesOnFromTheLastState) {
  Pair pair;
  pair.begin();
  pair.first.flag = true;
  pair.first.mode = Mode::on;
  pair.first.number = 0x123456789ABCDEFULL;
  pair.first.began = pair.now - Duration::milliseconds(3);
  pair.step();
  const double last = *pair.first.commanded;
  int steps = 0;
  for (; !pair.spare.commanded && steps < 100; ++steps) pair.step(false);
  EXPECT_GE(steps, 10);
  EXPECT_LE(steps, 12);
  EXPECT_EQ(*pair.spare.commanded, last + 1.0);
  EXPECT_TRUE(pair.spare.flag);
  EXPECT_EQ(pair.spare.mode, Mode::on);
  EXPECT_EQ(pair.spare.number, 0x123456789ABCDEFULL);
  EXPECT_EQ(pair.spare.began, pair.first.began);
  EXPECT_STREQ(pair.spare.standby().role(), "took over");
  EXPECT_THAT(pair.said,
              testing::ElementsAre(
                  "spare: took over from `first` (its beats stay away), and goes on from its state"));
}

TEST(Standby, OneThatComesBackStandsByAndTakesOverInItsTurn) {
  Pair pair;
  pair.begin();
  pair.steps(20, false);
  ASSERT_TRUE(pair.spare.commanded);
  pair.restart(pair.first);
  pair.steps(3000);
  EXPECT_FALSE(pair.first.commanded);
  const double last = *pair.spare.commanded;
  pair.steps(20, true, false);
  ASSERT_TRUE(pair.first.commanded);
  EXPECT_NEAR(*pair.first.commanded, last + 10.0, 3.0);
  EXPECT_STREQ(pair.first.standby().role(), "active");
}

TEST(Standby, OneThatWasStoppedAndGoesOnDoesNotFight) {
  Pair pair;
  pair.begin();
  pair.steps(500, false);
  for (int i = 0; i < 50; ++i) {
    pair.step();
    EXPECT_FALSE(pair.first.commanded) << i;
    EXPECT_TRUE(pair.spare.commanded) << i;
  }
  EXPECT_THAT(pair.said, testing::Contains("first: stands by: `spare` leads by now"));
}

TEST(Standby, ALeaderThatStoodStillListensBeforeItCommands) {
  Pair pair;
  pair.begin();
  pair.steps(8, false);  // shorter than the deadline: nobody has taken over
  pair.linked = false;   // what the other sent is on its way
  pair.step();
  EXPECT_FALSE(pair.first.commanded);
  pair.linked = true;
  pair.steps(2);
  EXPECT_TRUE(pair.first.commanded);
  EXPECT_FALSE(pair.spare.commanded);
}

TEST(Standby, ALeaderWithoutAStandbyDoesNotWaitForIt) {
  Pair pair;
  pair.begin();
  pair.steps(50, true, false);
  ASSERT_TRUE(pair.first.commanded);
  pair.steps(8, false, false);
  pair.step(true, false);
  EXPECT_TRUE(pair.first.commanded);
}

TEST(Standby, OneThatStoodStillItselfCountsItsOwnSteps) {
  Pair pair;
  pair.begin();
  pair.now += Duration::seconds(5.0);  // the whole PC was held up
  pair.first.set_now(pair.now, pair.cycle);
  pair.step(false);
  EXPECT_FALSE(pair.spare.commanded);
  pair.steps(5);
  EXPECT_TRUE(pair.first.commanded);
  EXPECT_FALSE(pair.spare.commanded);
}

TEST(Standby, OfTwoThatLedWhileTheyWereCutTheLaterTermLeads) {
  Pair pair;
  pair.begin();
  pair.linked = false;
  pair.steps(50);
  ASSERT_TRUE(pair.first.commanded && pair.spare.commanded) << "each is alone as far as it knows";
  pair.linked = true;
  pair.two_may_command = true;  // until the first has heard a beat
  pair.step();
  pair.two_may_command = false;
  pair.steps(3);
  EXPECT_FALSE(pair.first.commanded);
  EXPECT_TRUE(pair.spare.commanded);
  EXPECT_THAT(pair.said.back(), "first: stands by: `spare` leads by now");
}

TEST(Standby, ADeviceThatIsCommandedIsNotTakenOver) {
  Pair pair;
  pair.spare.device_is_free = false;
  pair.begin();
  pair.linked = false;
  pair.steps(5000);
  EXPECT_TRUE(pair.first.commanded);
  EXPECT_FALSE(pair.spare.commanded);
  EXPECT_THAT(pair.said, testing::ElementsAre(
                             "spare: does not lead: not heard is `first`, but the device is commanded"));
}

TEST(Standby, OneThatReachesItsDeviceTakesThePlaceOfOneThatDoesNot) {
  Pair pair;
  pair.begin();
  pair.first.reaches = false;
  pair.steps(900);
  EXPECT_TRUE(pair.first.commanded) << "a moment is no reason";
  pair.steps(200);
  EXPECT_FALSE(pair.first.commanded);
  EXPECT_TRUE(pair.spare.commanded);
  EXPECT_THAT(
      pair.said,
      testing::ElementsAre(
          "first: stands by: `spare` can go on",
          "spare: took over from `first` (it said that it cannot go on), and goes on from its state"));
  pair.spare.reaches = false;
  pair.steps(3000);
  EXPECT_TRUE(pair.spare.commanded) << "the other does not reach it either";
}

TEST(Standby, OneWhoseProcessIsAboutToEndHandsOverWithoutAGap) {
  Pair pair;
  pair.begin();
  pair.first.standby().hand_over();
  EXPECT_TRUE(pair.first.standby().is_needed());
  double last = 0.0;
  int idle = 0;
  for (int steps = 0; steps < 2000 && pair.first.standby().is_needed(); ++steps) {
    last = pair.first.commanded.value_or(last);
    pair.step();
  }
  for (; !pair.spare.commanded && idle < 100; ++idle) pair.step();
  EXPECT_LE(idle, 1);
  EXPECT_NEAR(*pair.spare.commanded, last + 1.0, 1.0);
  EXPECT_FALSE(pair.first.standby().leads());
  pair.steps(3000);
  EXPECT_TRUE(pair.spare.commanded) << "it is not handed back";
}

TEST(Standby, WhereBothProcessesAreAboutToEndOneWaitsForTheOther) {
  Pair pair;
  pair.begin();
  pair.first.standby().hand_over();
  pair.spare.standby().hand_over();
  pair.steps(3);
  EXPECT_TRUE(pair.spare.standby().is_needed()) << "the leader cannot go on";
  for (int steps = 0; steps < 2000 && pair.first.standby().is_needed(); ++steps) pair.step();
  pair.steps(3);
  ASSERT_TRUE(pair.spare.commanded);
  for (int steps = 0; steps < 500; ++steps) {  // the first one's process starts anew
    pair.step(false);
    ASSERT_TRUE(pair.spare.commanded && pair.spare.standby().is_needed()) << steps;
  }
  pair.restart(pair.first);
  for (int steps = 0; steps < 3000 && pair.spare.standby().is_needed(); ++steps) pair.step();
  pair.steps(3);
  EXPECT_TRUE(pair.first.commanded);
  EXPECT_FALSE(pair.spare.standby().leads());
}

TEST(Standby, OneThatHandedOverDoesNotAskBack) {
  Pair pair;
  pair.begin();
  pair.first.standby().hand_over();
  pair.spare.standby().hand_over();
  int changes = 0;
  bool led = true;
  for (int steps = 0; steps < 10000; ++steps) {  // neither process ends in time
    pair.step();
    changes += static_cast<int>(std::exchange(led, pair.first.standby().leads()) != led);
  }
  EXPECT_EQ(changes, 1);
  EXPECT_TRUE(pair.spare.commanded);
}

TEST(Standby, OneThatIsSteppedSeldomGoesOnFromTheStateThatWasHandedOver) {
  Pair pair;
  pair.begin();
  pair.first.standby().hand_over();
  double last = 0.0;
  int steps = 0;
  for (; steps < 8000 && pair.first.standby().is_needed(); ++steps) {
    pair.step(true, steps % 5 == 0);
    last = pair.first.commanded.value_or(last);
  }
  ASSERT_LT(steps, 8000);
  pair.first.standby().resign();
  pair.step(false);
  ASSERT_TRUE(pair.spare.commanded);
  EXPECT_NEAR(*pair.spare.commanded, last, 12.0);
  EXPECT_THAT(pair.said.back(), testing::HasSubstr("goes on from its state"));
}

TEST(Standby, NobodyHandsOverToOneThatCouldNotGoOn) {
  Pair pair;
  pair.begin();
  pair.spare.reaches = false;
  pair.first.standby().hand_over();
  pair.steps(3);
  EXPECT_FALSE(pair.first.standby().is_needed()) << "there is nobody to wait for";
  pair.steps(3000);
  EXPECT_TRUE(pair.first.commanded);
}

TEST(Standby, OneThatReachesNeitherDeviceNorOtherCommandsNoMoreUntilItHearsOne) {
  Pair pair;
  pair.begin();
  pair.linked = false;
  pair.first.reaches = false;
  pair.first.device_is_free = false;
  pair.steps(13);
  EXPECT_FALSE(pair.first.commanded);
  EXPECT_TRUE(pair.spare.commanded);
  pair.first.reaches = true;  // the cable is back, and the device comes before the other
  pair.steps(20);
  EXPECT_FALSE(pair.first.commanded) << "the device shows that it is commanded";
  pair.linked = true;
  pair.steps(50);
  EXPECT_FALSE(pair.first.commanded);
  EXPECT_THAT(pair.said.back(), "first: stands by: `spare` leads by now");
}

TEST(Standby, OneThatYieldedForNothingLeadsAgain) {
  Pair pair;
  pair.begin();
  pair.linked = false;
  pair.first.reaches = pair.first.device_is_free = false;
  pair.steps(30, true, false);
  EXPECT_FALSE(pair.first.commanded);
  const double before = pair.first.count;
  pair.first.reaches = pair.first.device_is_free = true;
  pair.steps(20, true, false);
  EXPECT_TRUE(pair.first.commanded);
  EXPECT_NEAR(*pair.first.commanded, before + 20.0, 2.0);
}

TEST(Standby, AProcessThatHasEndedNeedsNeitherDeadlineNorDevice) {
  Pair pair;
  pair.spare.device_is_free = false;
  auto same_pc = *pair.spare.standby().paired();
  same_pc.is_same_pc = true;
  pair.spare.standby().pair(same_pc);
  pair.begin();
  pair.spare.standby().look_for_process([](std::int32_t) { return true; });
  pair.step();
  pair.spare.standby().look_for_process([](std::int32_t process) { return process != 1; });
  pair.step(false);
  EXPECT_TRUE(pair.spare.commanded);
  EXPECT_THAT(pair.said,
              testing::ElementsAre(
                  "spare: took over from `first` (its process has ended), and goes on from its state"));
}

TEST(Standby, ThatAProcessOfAnotherPcHasEndedIsTakenFromItsLauncherThoughItsLastBeatCameSince) {
  Pair pair;
  pair.spare.device_is_free = false;
  pair.begin();
  pair.spare.standby().hear_of_end(7);  // of an earlier life
  pair.step();
  EXPECT_FALSE(pair.spare.commanded);
  pair.spare.standby().hear_of_end(1);
  pair.two_may_command = true;  // its last beat, by a step that was before its end
  pair.step();
  EXPECT_TRUE(pair.spare.commanded);
  EXPECT_THAT(
      pair.said,
      testing::Contains("spare: took over from `first` (its process has ended), and goes on from its state"));
}

TEST(Standby, AProcessThatWasNeverSeenIsNotTakenForDead) {
  Pair pair;
  auto same_pc = *pair.spare.standby().paired();
  same_pc.is_same_pc = true;
  pair.spare.standby().pair(same_pc);
  pair.begin();
  pair.spare.standby().look_for_process([](std::int32_t) { return false; });
  pair.step(false);
  EXPECT_FALSE(pair.spare.commanded);
}

TEST(Standby, WhatAPersonStoppedStaysSo) {
  Pair pair;
  pair.begin();
  pair.first.deactivate();
  pair.steps(5000, false);
  EXPECT_FALSE(pair.spare.commanded);
  EXPECT_THAT(pair.spare.standby().fault(), testing::StartsWith("nobody leads: `first`"));
  pair.restart(pair.first);
  pair.steps(3);
  EXPECT_TRUE(pair.first.commanded) << "activated, it leads again";
  EXPECT_EQ(pair.spare.standby().fault(), "");
}

TEST(Standby, OneThatIsAskedLeadsAndTheOtherHandsOverWithoutAStep) {
  Pair pair;
  pair.begin();
  const double before = *pair.first.commanded;
  EXPECT_TRUE(pair.spare.standby().ask());
  EXPECT_FALSE(pair.first.standby().ask()) << "it leads";
  pair.steps(4);
  EXPECT_FALSE(pair.first.commanded);
  ASSERT_TRUE(pair.spare.commanded);
  EXPECT_GE(*pair.spare.commanded, before);
  EXPECT_LE(*pair.spare.commanded, before + 4.0);
  EXPECT_TRUE(pair.first.standby().ask());
  pair.steps(4);
  EXPECT_TRUE(pair.first.commanded);
  EXPECT_FALSE(pair.spare.commanded);
}

TEST(Standby, OneThatIsToldToRestHandsOverNoMore) {
  Pair pair;
  pair.begin();
  ASSERT_TRUE(pair.spare.standby().ask());
  pair.step();  // the spare asks
  for (Counter* each : {&pair.first, &pair.spare}) each->standby().leave();
  pair.steps(50);
  EXPECT_TRUE(pair.first.commanded) << "it brings to rest what it moves";
  pair.first.deactivate();
  pair.steps(50, false);
  EXPECT_FALSE(pair.spare.commanded) << "all is at rest";
}

TEST(Standby, OneThatIsToldToRestWhileItIsHandedTheLeadTakesIt) {
  Pair pair;
  pair.begin();
  ASSERT_TRUE(pair.spare.standby().ask());
  pair.step();                   // the spare asks
  pair.spare.standby().leave();  // before it hears that the first one steps down
  pair.step();
  EXPECT_FALSE(pair.first.commanded);
  EXPECT_TRUE(pair.spare.commanded) << "else nobody would bring the axis to rest";
}

TEST(Standby, ASpareThatNeverHeardALeaderWaitsForAPerson) {
  Pair pair;
  pair.steps(5000, false);
  EXPECT_FALSE(pair.spare.commanded);
  EXPECT_NE(pair.spare.standby().fault(), "");
  EXPECT_TRUE(pair.spare.standby().ask());
  pair.step(false);
  EXPECT_TRUE(pair.spare.commanded);
}

TEST(Standby, TheFirstLeadsAloneAfterItHasListened) {
  Pair pair;
  int steps = 0;
  for (; !pair.first.commanded && steps < 5000; ++steps) pair.step(true, false);
  EXPECT_NEAR(steps, 2000, 5);
}

TEST(Standby, AStateOfAnotherVersionOrWithAWrongNumberIsNotTaken) {
  for (const bool wrong_number : {false, true}) {
    Pair pair;
    pair.begin();
    standby::WarmState beat;
    dynamic_cast<Output<standby::WarmState>&>(*pair.first.find_port("warm"))
        .add_sink([&](const standby::WarmState& sample, Instant) { beat = sample; });
    pair.first.has_more = !wrong_number;
    pair.step();
    if (wrong_number) beat.values()[0] = 2e6;  // outside the range of `count`
    pair.spoilt = {beat};
    pair.step();
    pair.steps(15, false);
    ASSERT_TRUE(pair.spare.commanded);
    EXPECT_LT(*pair.spare.commanded, 10.0);
    EXPECT_THAT(pair.said.back(), testing::HasSubstr("begins anew"));
  }
}

TEST(Standby, InSimulatedTimeNobodyTakesOver) {
  Pair pair;
  pair.first.simulated_time = pair.spare.simulated_time = true;
  pair.restart(pair.first);
  pair.restart(pair.spare);
  pair.step();
  EXPECT_TRUE(pair.first.commanded);
  pair.steps(100, false);
  EXPECT_FALSE(pair.spare.commanded);
}

TEST(Standby, NeitherAllocatesNorLocks) {
  Pair pair;
  pair.begin();
  pair.said.reserve(8);
  const support::RealTimeGuard guard;
  for (int i = 0; i < 15; ++i) {
    pair.now += period;
    pair.spare.set_now(pair.now, ++pair.cycle);
    pair.spare.step({pair.now, period.in_seconds(), pair.cycle});
  }
  const auto violations = guard.violations();
  EXPECT_TRUE(pair.spare.commanded);
  EXPECT_LE(violations, 2U) << "the list of this test";
}

}  // namespace
}  // namespace invar
