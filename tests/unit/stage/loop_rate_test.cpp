// A stage whose loop is stepped seldom, at a lowered rate, or not at all for a while.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "components/stage/axis_stage.hpp"
#include "core/physics/axis_controller.hpp"
#include "tests/support/stage_bench.hpp"

namespace invar::stage {
namespace {

using Bench = StageBench;

TEST(Stage, OneThatIsSteppedEveryFewCyclesHasItsFullGains) {
  Bench plain, slow;
  slow.every = 4;
  for (Bench* bench : {&plain, &slow}) {
    bench->enable();
    bench->send(AXIS_COMMAND_MOVE, 0.15);
  }
  for (int i = 0; i < 500; ++i) ASSERT_EQ(plain.cycle_once().current(), slow.cycle_once().current()) << i;
}

TEST(Stage, OneThatIsEnabledWhileTheRateIsLoweredHoldsAndMoves) {
  for (const unsigned stretch : {2U, 4U, 8U}) {
    Bench bench;
    bench.stretch = stretch;
    bench.enable();
    bench.position += 20e-6;  // a push
    double farthest = 0.0;
    for (int i = 0; i < 500; ++i)
      farthest = std::max(farthest, std::abs(bench.cycle_once().following_error()));
    EXPECT_LT(farthest, 50e-6) << stretch;
    bench.send(AXIS_COMMAND_MOVE, 0.15);
    EXPECT_TRUE(bench.run_until([](const AxisState& s) { return s.settled() && s.command_done(); }))
        << stretch;
    EXPECT_NEAR(bench.position, 0.15, 1e-4) << stretch;
  }
}

/// Every third period of a loop whose rate is halved: every fourth, 4/3 of its own.
TEST(Stage, AStepThatIsLongerByAThirdHasTheGainsOfIt) {
  Bench bench;
  bench.stretch = 4;
  bench.own_period = 3e-3;
  bench.enable();
  for (int i = 0; i < 200; ++i) bench.cycle_once();  // at rest
  physics::AxisControllerSettings settings;
  const auto& control = bench.parameters.control;
  settings.rate = 1.0 / bench.own_period, settings.kp = control.kp, settings.ki = control.ki;
  settings.kd = control.kd, settings.velocity_filter_hz = control.velocity_filter;
  settings.limit = control.limit;
  physics::AxisController expected{settings};
  const double at = bench.state.latest()->setpoint_position();
  (void)expected.step(at, at, 4.0 / 3.0);
  bench.position += 10e-6;
  for (int i = 0; i < 20; ++i) {
    const AxisState& state = bench.cycle_once();
    ASSERT_NEAR(state.current(), expected.step(at, bench.position, 4.0 / 3.0), 1e-9) << i;
  }
}

TEST(Stage, AStallAtALoweredRateIsRejoinedBeforeTheDriveSwitchesOff) {
  Bench bench;
  bench.stretch = 8;
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.15);
  const double cruise = bench.parameters.limits.velocity;
  ASSERT_TRUE(bench.run_until([&](const AxisState& s) { return s.setpoint_velocity() > 0.99 * cruise; }));
  const double before = bench.state.latest()->setpoint_position();
  bench.cycle += 40;
  bench.velocity = 0.0;  // a hard stop meanwhile
  const AxisState after = bench.cycle_once();
  EXPECT_EQ(after.mode(), AXIS_MODE_MOVING) << "tripped by its following error";
  EXPECT_LT(after.setpoint_position() - before, 2.1 * cruise * 8.0 * Bench::period);
}

TEST(Stage, ALoopThatStoodStillAsksForNoLeap) {
  Bench bench;
  bench.enable();
  bench.send(AXIS_COMMAND_MOVE, 0.15);
  const double cruise = bench.parameters.limits.velocity;
  ASSERT_TRUE(bench.run_until([&](const AxisState& s) { return s.setpoint_velocity() > 0.99 * cruise; }));
  const double before = bench.state.latest()->setpoint_position();
  bench.cycle += 90;      // 90 ms, in which the drive lets go
  bench.velocity *= 0.5;  // and friction brakes
  const AxisState after = bench.cycle_once();
  EXPECT_LT(after.setpoint_position() - before, 2.1 * cruise * Bench::period);
  double fastest = 0.0;
  ASSERT_TRUE(bench.run_until([&](const AxisState& s) {
    fastest = std::max(fastest, bench.velocity);
    return s.settled() && s.command_done();
  }));
  EXPECT_LT(fastest, 1.5 * cruise);  // 1.37: the servo makes up for the lost velocity
  EXPECT_NEAR(bench.position, 0.15, 1e-4);
}

TEST(Stage, ACarriageThatDroveOnWhileItsLoopStoodStillIsNotTornBack) {
  for (const unsigned gone : {13U, 41U, 90U}) {
    Bench bench;
    bench.enable();
    bench.send(AXIS_COMMAND_MOVE, 0.15);
    const double cruise = bench.parameters.limits.velocity;
    ASSERT_TRUE(bench.run_until([&](const AxisState& s) { return s.setpoint_velocity() > 0.99 * cruise; }));
    bench.cycle_once();
    const double current = bench.state.latest()->current();
    bench.cycle += gone;
    bench.position += bench.velocity * gone * Bench::period;  // the last current keeps its speed up
    const AxisState after = bench.cycle_once();
    EXPECT_NEAR(after.current(), current, 0.2) << gone;
    double slowest = cruise, fastest = 0.0;
    ASSERT_TRUE(bench.run_until([&](const AxisState& s) {
      if (s.setpoint_velocity() > 0.99 * cruise) slowest = std::min(slowest, bench.velocity);
      fastest = std::max(fastest, bench.velocity);
      return s.settled() && s.command_done();
    }));
    EXPECT_GT(slowest, 0.9 * cruise) << gone;
    EXPECT_LT(fastest, 1.1 * cruise) << gone;
    EXPECT_NEAR(bench.position, 0.15, 1e-4);
  }
}

}  // namespace
}  // namespace invar::stage
