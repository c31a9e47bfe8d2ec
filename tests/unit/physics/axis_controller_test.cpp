// The controllers against their difference equations, worked by hand.
#include "core/physics/axis_controller.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

namespace invar::physics {
namespace {

TEST(AxisController, PidFiltersTheDifferenceAndSumsTheError) {
  AxisControllerSettings s;
  s.kp = 10.0, s.ki = 200.0, s.kd = 0.5, s.velocity_filter_hz = 100.0, s.limit = 50.0;
  AxisController pid{s};
  const double a = 1.0 - std::exp(-2.0 * std::numbers::pi * 0.1);
  EXPECT_NEAR(pid.step(0.1, 0.0), 10.0 * 0.1 + 200.0 * 0.1 / 1000.0, 1e-12);  // e[-1] = e[0]
  const double d = a * 0.1 * 1000.0;
  EXPECT_NEAR(pid.step(0.2, 0.0), 10.0 * 0.2 + 200.0 * 0.3 / 1000.0 + 0.5 * d, 1e-12);
}

TEST(AxisController, TheSumStandsWhileTheOutputClamps) {
  AxisControllerSettings s;
  s.kp = 1.0, s.ki = 1000.0, s.limit = 1.0;
  AxisController pid{s};
  for (int i = 0; i < 10; ++i) EXPECT_EQ(pid.step(5.0, 0.0), 1.0);
  EXPECT_NEAR(pid.step(0.1, 0.0), 0.2, 1e-12);  // nothing but this error is in the sum
}

TEST(AxisController, CascadeBrakesByTheMeasuredSpeed) {
  AxisControllerSettings s;
  s.kind = AxisControllerSettings::Kind::cascade;
  s.kp = 50.0, s.kv = 2.0, s.limit = 100.0;
  AxisController cascade{s};
  EXPECT_NEAR(cascade.step(0.01, 0.0), 2.0 * 0.5, 1e-12);
  EXPECT_NEAR(cascade.step(0.01, 0.001), 2.0 * (50.0 * 0.009 - 1.0), 1e-12);
}

}  // namespace
}  // namespace invar::physics
