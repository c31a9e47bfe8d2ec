// The controllers against their difference equations, worked by hand.
#include "core/physics/axis_controller.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <utility>

#include "core/physics/axis_plant.hpp"

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

TEST(AxisController, AfterAGapTheDifferenceIsOverAllOfItAndTheGainsAreThoseOfASlowerLoop) {
  AxisControllerSettings s;
  s.kp = 10.0, s.ki = 200.0, s.kd = 0.5;
  AxisController pid{s};
  (void)pid.step(0.0, 0.0);
  const double command =
      10.0 / 16.0 * 0.1 + 200.0 / 64.0 * 0.1 * 4.0 / 1000.0 + 0.5 / 4.0 * 0.1 * 1000.0 / 4.0;
  EXPECT_NEAR(pid.step(0.1, 0.0, 4.0), command, 1e-12);
  for (int i = 0; i < 30; ++i) (void)pid.step(0.0, 0.0);
  AxisController kept{s};
  (void)kept.step(0.0, 0.0);
  const double offset = pid.step(0.0, 0.0);  // of the sum
  EXPECT_NEAR(pid.step(0.1, 0.0) - offset, kept.step(0.1, 0.0), 1e-12);
}

TEST(AxisController, OneThatGoesOnFromACurrentCommandsItNextAndWhatTheSumAddsThen) {
  AxisControllerSettings s;
  s.kp = 10.0, s.ki = 200.0, s.kd = 0.5;
  for (const double periods : {1.0, 8.0}) {
    AxisController pid{s};
    ASSERT_TRUE(pid.go_on_from(3.0, 0.1, periods));
    const double soft = 1.0 / periods;
    EXPECT_NEAR(pid.step(0.1, 0.0, periods), 3.0 + 200.0 * soft * soft * 0.1 / 1000.0, 1e-12);
  }
  s.kind = AxisControllerSettings::Kind::cascade;
  EXPECT_FALSE(AxisController{s}.go_on_from(3.0, 0.1)) << "it has no sum";
}

/// How far [m] an axis that is held goes from its place in 20 s, where its loop is due again after `gap` periods. Its drive holds
/// the current meanwhile, for 20 periods at most.
template <class Gap>
double wandering(const Gap& gap, std::mt19937_64& random) {
  AxisControllerSettings s;
  s.kp = 4e4, s.ki = 8e5, s.kd = 300.0, s.velocity_filter_hz = 300.0,
  s.limit = 10.0;  // as of an axis of the deployment
  constexpr double period = 1e-3;
  AxisPlant plant{{3.2, 12.0, 18.0}, {}, period};
  AxisController controller{s};
  plant.rest_at(0.0);
  std::normal_distribution<double> noise{0.0, 2e-8};
  double worst = 0.0, current = 0.0;
  int due = 0, last = -1;
  for (int k = 0; k < 20000 && worst < 0.1; ++k) {
    if (k - last == 20) current = 0.0;  // the drive lets go
    if (k == due) {
      current = controller.step(0.0, plant.reading() + noise(random), k - std::exchange(last, k));
      due = k + gap(random);
    }
    plant.step(current, period);
    worst = std::max(worst, std::abs(plant.position()));
  }
  return worst;
}

TEST(AxisController, ALoopThatLosesPeriodsStaysStable) {
  const auto seed = std::random_device{}();
  std::mt19937_64 random{seed};
  SCOPED_TRACE("seed " + std::to_string(seed));
  EXPECT_LT(wandering([](auto&) { return 1; }, random), 1e-6);
  for (const int every : {2, 8, 15, 40})
    EXPECT_LT(wandering([=](auto&) { return every; }, random), 50e-6) << every << " periods a step";
  for (const auto& [share, length] : {std::pair{0.2, 3}, {0.1, 20}, {0.03, 50}, {0.5, 15}}) {
    std::bernoulli_distribution loses{share};
    EXPECT_LT(wandering([&](auto& by) { return loses(by) ? length : 1; }, random), 1e-3)
        << "one of " << 1.0 / share << " steps is followed by a gap of " << length << " periods";
  }
}

}  // namespace
}  // namespace invar::physics
