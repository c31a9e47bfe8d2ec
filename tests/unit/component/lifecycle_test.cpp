#include "core/component/lifecycle.hpp"

#include <gmock/gmock.h>

namespace invar {
namespace {

using enum LifecycleState;
using Kind = Decision::Kind;
constexpr LifecycleState states[] = {unconfigured, inactive, active, finalized, error};
constexpr Transition transitions[] = {Transition::configure, Transition::activate, Transition::deactivate,
                                      Transition::cleanup,   Transition::shutdown, Transition::reset};

TEST(Lifecycle, FollowsTheArrowsOfTheManagedNodeDesign) {
  struct Arrow {
    LifecycleState from;
    Transition by;
    LifecycleState to;
  };
  const Arrow arrows[] = {
      {unconfigured, Transition::configure, inactive}, {inactive, Transition::activate, active},
      {active, Transition::deactivate, inactive},      {inactive, Transition::cleanup, unconfigured},
      {unconfigured, Transition::shutdown, finalized}, {inactive, Transition::shutdown, finalized},
      {active, Transition::shutdown, finalized},       {error, Transition::shutdown, finalized},
      {error, Transition::reset, unconfigured},
  };
  int found = 0;
  for (const LifecycleState from : states)
    for (const Transition by : transitions) {
      const Decision decision = decide(from, by);
      const auto* arrow = std::find_if(std::begin(arrows), std::end(arrows),
                                       [&](const Arrow& a) { return a.from == from && a.by == by; });
      EXPECT_EQ(decision.kind == Kind::go, arrow != std::end(arrows)) << to_text(from) << " " << to_text(by);
      if (arrow == std::end(arrows)) continue;
      ++found;
      EXPECT_EQ(decision.target, arrow->to);
    }
  EXPECT_EQ(found, 9);
}

TEST(Lifecycle, ATransitionToTheStateAlreadyReachedIsSuccessAndDoingItTwiceIsNothingElse) {
  for (const LifecycleState from : states)
    for (const Transition by : transitions) {
      const Decision once = decide(from, by);
      if (once.kind == Kind::refused) {
        EXPECT_FALSE(once.reason.empty()) << to_text(from) << " " << to_text(by);
        continue;
      }
      const Decision twice = decide(once.target, by);
      EXPECT_EQ(twice.kind, Kind::already) << to_text(from) << " " << to_text(by);
      EXPECT_EQ(twice.target, once.target);
    }
}

TEST(Lifecycle, NothingLeavesFinalizedAndNoRequestEntersError) {
  for (const Transition by : transitions) EXPECT_NE(decide(finalized, by).kind, Kind::go);
  for (const LifecycleState from : states)
    for (const Transition by : transitions)
      EXPECT_FALSE(decide(from, by).kind == Kind::go && decide(from, by).target == error);
}

TEST(Lifecycle, TransitionNamesAreReadBack) {
  for (const Transition t : transitions) EXPECT_EQ(parse_transition(to_text(t)), t);
  EXPECT_EQ(parse_transition("Activate"), std::nullopt);
}

TEST(RequestLog, AnswersARepeatedIdAsBeforeAndRefusesItForAnotherRequest) {
  RequestLog log{2};
  EXPECT_FALSE(log.find(7, "stage", Transition::activate));
  log.remember("stage", Transition::activate, {7, Verdict::failed, error, "no sample"});
  const auto again = log.find(7, "stage", Transition::activate);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->verdict, Verdict::failed);
  EXPECT_EQ(again->reason, "no sample");
  EXPECT_EQ(log.find(7, "stage", Transition::deactivate)->verdict, Verdict::refused);
  EXPECT_EQ(log.find(7, "heater", Transition::activate)->verdict, Verdict::refused);
  log.remember("stage", Transition::activate, {8, Verdict::done, active, ""});
  log.remember("stage", Transition::activate, {9, Verdict::done, active, ""});
  EXPECT_FALSE(log.find(7, "stage", Transition::activate)) << "the oldest is forgotten";
  log.remember("stage", Transition::activate, {0, Verdict::done, active, ""});
  EXPECT_FALSE(log.find(0, "stage", Transition::activate)) << "id 0 is not an identity";
}

}  // namespace
}  // namespace invar
