// A stage that stands by for another one goes on with its motion: the same trajectory, no step of the current, the same command.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "tests/support/real_time_guard.hpp"
#include "tests/support/wired_axis.hpp"

namespace invar::stage {
namespace {

world::SimulatedStage::Parameters of_world() {
  world::SimulatedStage::Parameters world;
  world.machine = INVAR_SOURCE_DIR "/deployment/machines/linear-axis.yaml";
  world.x.start = 0.02;
  world.watchdog = 0.05;
  return world;
}

Stage::Parameters of_stage() {
  Stage::Parameters stage;
  stage.control.feedforward_acceleration = 3.2 / 12.0;
  stage.control.feedforward_velocity = 25.0 / 12.0;
  return stage;
}

struct TwoStages {
  TwoStages() {
    wired.join(world, "feedback_x", first, "feedback");
    wired.join(world, "feedback_x", spare, "feedback");
    wired.join(first, "warm", spare, "other");
    wired.join(spare, "warm", first, "other");
    for (Stage* stage : {&first, &spare}) {
      wired.join(*stage, "motor", world, "motor_x");
      wired.join(*stage, "state", hand, "state");
      wired.join(hand, "command", *stage, "command");
      stage->standby().pair({.other = "the other",
                             .command = "",
                             .is_spare = stage == &spare,
                             .deadline = Duration::milliseconds(10),
                             .process = 1});
      stage->id = 1;
    }
    world.simulated_time = true;
    for (Component* component : parts) {
      component->configure();
      component->set_now(now);
      component->activate();
    }
    run(20);
    tell(AXIS_COMMAND_ENABLE);
    run(20);
  }
  void run(int cycles, bool with_first = true, bool with_spare = true) {
    for (int i = 0; i < cycles; ++i) {
      now += Duration::milliseconds(1);
      ++cycle;
      for (Component* component : parts) {
        if ((component == &first && !with_first) || (component == &spare && !with_spare)) continue;
        component->set_now(now, cycle);
        component->step({now, 1e-3, cycle});
      }
    }
  }
  void tell(AxisCommandKind kind, double position = 0.0) {
    AxisCommand told;
    told.kind(kind);
    told.position(position);
    told.id(++told_);
    hand.command.write(told);
  }
  const AxisState& state() { return *hand.state.latest(); }

  world::SimulatedStage::Parameters world_parameters = of_world();
  Stage::Parameters stage_parameters = of_stage();
  support::Wired wired;
  world::SimulatedStage world{world_parameters};
  Stage first{stage_parameters}, spare{stage_parameters};
  support::Hand hand;
  std::array<Component*, 3> parts{&world, &first, &spare};
  Instant now;
  std::uint64_t cycle = 0;
  std::uint64_t told_ = 0;
};

TEST(StandbyStage, GoesOnWithTheMotionOfTheOneThatIsLost) {
  for (const int after : {30, 100, 400, 1340}) {  // rising, nearly at speed, at speed, braking
    TwoStages two;
    two.tell(AXIS_COMMAND_MOVE, 0.15);
    two.run(after);
    ASSERT_EQ(two.state().mode(), AXIS_MODE_MOVING) << after;
    const double current = two.state().current();
    const std::uint64_t command = two.state().command_id();
    two.run(10, false);
    EXPECT_EQ(two.spare.standby().leads(), false) << "the deadline is not over";
    two.run(1, false);
    ASSERT_TRUE(two.spare.standby().leads()) << after;
    EXPECT_EQ(two.state().mode(), AXIS_MODE_MOVING) << after;
    EXPECT_EQ(two.state().command_id(), command);
    EXPECT_FALSE(two.state().command_done());
    // What the drive does while nobody commands it costs a tenth of the limit at most.
    EXPECT_NEAR(two.state().current(), current, 1.0) << after;
    double worst = 0.0;
    for (int i = 0; i < 2500; ++i) {
      two.run(1, false);
      worst = std::max(worst, std::abs(two.state().following_error()));
    }
    EXPECT_LT(worst, 2e-4) << after;
    EXPECT_EQ(two.state().mode(), AXIS_MODE_HOLDING) << after;
    EXPECT_TRUE(two.state().command_done());
    EXPECT_FALSE(two.state().command_refused());
    EXPECT_NEAR(two.state().position(), 0.15, 1e-6) << after;
  }
}

TEST(StandbyStage, HoldsAnAxisAtRestWithTheSameCurrent) {
  TwoStages two;
  two.run(500);
  ASSERT_EQ(two.state().mode(), AXIS_MODE_HOLDING);
  const double current = two.state().current(), position = two.state().position();
  two.run(11, false);
  ASSERT_TRUE(two.spare.standby().leads());
  EXPECT_NEAR(two.state().current(), current, 0.1) << "a hundredth of the limit";
  two.run(500, false);
  EXPECT_NEAR(two.state().position(), position, 1e-7);
}

TEST(StandbyStage, WritesNothingWhileItStandsBy) {
  TwoStages two;
  auto& motor = dynamic_cast<OutputPort&>(*two.spare.find_port("motor"));
  two.run(200);
  EXPECT_EQ(motor.written(), 0U);
}

TEST(StandbyStage, CarriesOutACommandThatTheOtherDidNotHearAnyMore) {
  TwoStages two;
  two.run(5, false);
  two.tell(AXIS_COMMAND_MOVE, 0.05);
  two.run(2000, false);
  EXPECT_NEAR(two.state().position(), 0.05, 1e-6);
  EXPECT_EQ(two.state().command_id(), two.told_);
}

TEST(StandbyStage, DoesNotCarryOutAgainWhatWasDone) {
  TwoStages two;
  two.tell(AXIS_COMMAND_MOVE, 0.03);
  two.run(1500);
  two.tell(AXIS_COMMAND_MOVE, 0.04);
  two.run(1500);
  two.tell(AXIS_COMMAND_STOP);
  two.run(100);
  two.run(100, false);
  ASSERT_TRUE(two.spare.standby().leads());
  EXPECT_EQ(two.state().mode(), AXIS_MODE_HOLDING);
  EXPECT_NEAR(two.state().position(), 0.04, 1e-6);
}

TEST(StandbyStage, OneThatComesBackDoesNotDisableTheDrive) {
  TwoStages two;
  two.tell(AXIS_COMMAND_MOVE, 0.15);
  two.run(300);
  two.run(30, false);
  two.first.set_now(two.now, two.cycle);
  two.first.activate();  // a new life of its process
  for (int i = 0; i < 300; ++i) {
    two.run(1);
    ASSERT_EQ(two.state().mode(), AXIS_MODE_MOVING) << i;
  }
  EXPECT_STREQ(two.first.standby().role(), "standby");
}

TEST(StandbyStage, NeitherAllocatesNorLocks) {
  TwoStages two;
  two.tell(AXIS_COMMAND_MOVE, 0.15);
  two.run(300);
  const support::RealTimeGuard guard;
  two.run(20);
  two.run(100, false);
  const auto violations = guard.violations();
  EXPECT_TRUE(two.spare.standby().leads());
  EXPECT_EQ(violations, 0U);
}

}  // namespace
}  // namespace invar::stage
