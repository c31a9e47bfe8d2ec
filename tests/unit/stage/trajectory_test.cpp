#include "components/stage/trajectory.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace invar::stage {
namespace {

constexpr MotionLimits limits{0.2, 2.0, 50.0};

/// Integrates the velocity and bounds velocity, acceleration and jerk along a trajectory.
void check(const Trajectory& trajectory, const MotionPoint& start) {
  const double dt = 1e-5;
  MotionPoint before = start;
  double way = start.position;
  for (double t = dt; t < trajectory.duration() + 2 * dt; t += dt) {
    const MotionPoint now = trajectory.at(t);
    ASSERT_LE(std::abs(now.velocity), std::max(limits.velocity, std::abs(start.velocity) + 0.05) + 1e-9);
    ASSERT_LE(std::abs(now.acceleration), std::max(limits.acceleration, std::abs(start.acceleration)) + 1e-9);
    ASSERT_LE(std::abs(now.acceleration - before.acceleration), limits.jerk * dt * 1.001 + 1e-9);
    way += (before.velocity + now.velocity) / 2 * dt;
    ASSERT_NEAR(now.position, way, 1e-7);
    before = now;
  }
  EXPECT_EQ(before.velocity, 0.0);
  EXPECT_EQ(before.acceleration, 0.0);
}

TEST(Trajectory, MovesFromRestToRestWithinItsLimits) {
  for (const double to : {1e-6, 1e-4, -2e-3, 0.01, 0.05, -0.2, 0.4}) {
    const auto trajectory = Trajectory::move(0.1, to, limits);
    check(trajectory, {0.1, 0.0, 0.0});
    EXPECT_DOUBLE_EQ(trajectory.target(), to);
  }
}

TEST(Trajectory, TakesTheTextbookTimeWhenItCruises) {
  // T = distance / v + v / a + a / j where velocity and acceleration limits are both reached.
  EXPECT_NEAR(Trajectory::move(0.0, 0.4, limits).duration(), 0.4 / 0.2 + 0.2 / 2.0 + 2.0 / 50.0, 1e-12);
}

TEST(Trajectory, ShortMoveTakesTheTimeOfPureJerk) {
  // D = 2 j T^3 with four ramps of T.
  const double ramp = std::cbrt(1e-5 / (2 * limits.jerk));
  EXPECT_NEAR(Trajectory::move(0.0, 1e-5, limits).duration(), 4 * ramp, 1e-12);
}

TEST(Trajectory, StopsFromAnyPointOfAMove) {
  const unsigned seed = std::random_device{}();
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random{seed};
  const auto move = Trajectory::move(0.0, 0.1, limits);
  std::uniform_real_distribution<double> time{0.0, move.duration()};
  for (int i = 0; i < 20; ++i) {
    const double t = time(random);
    SCOPED_TRACE("seed " + std::to_string(seed) + ", stop at " + std::to_string(t) + " s");
    const auto stop = Trajectory::stop(move.at(t), limits);
    check(stop, move.at(t));
    EXPECT_LE(stop.target(), 0.1 + 1e-9);
    EXPECT_GE(stop.target(), move.at(t).position);
    EXPECT_LE(t + stop.duration(), move.duration() + 1e-6);
  }
}

TEST(Trajectory, SineIsAtRestAtItsEndsAndItsVelocityIsItsSlope) {
  const auto sine = Trajectory::sine(0.05, -0.02, 1.05, 3);
  EXPECT_NEAR(sine.duration(), 3.15, 1e-12);
  EXPECT_EQ(sine.at(0.0).velocity, 0.0);
  EXPECT_EQ(sine.target(), 0.05);
  EXPECT_NEAR(sine.at(1.05 / 2).position, 0.01, 1e-12);
  const double h = 1e-5;
  for (double t = 0.01; t < 3.1; t += 0.0137) {
    EXPECT_NEAR(sine.at(t).velocity, (sine.at(t + h).position - sine.at(t - h).position) / (2 * h), 1e-8);
    EXPECT_NEAR(sine.at(t).acceleration, (sine.at(t + h).velocity - sine.at(t - h).velocity) / (2 * h), 1e-7);
  }
  check(Trajectory::stop(sine.at(0.4), limits), sine.at(0.4));
}

TEST(Trajectory, StandsStillWhereNothingIsAsked) {
  EXPECT_EQ(Trajectory::rest(0.3).at(5.0).position, 0.3);
  EXPECT_EQ(Trajectory::move(0.3, 0.3, limits).duration(), 0.0);
}

}  // namespace
}  // namespace invar::stage
