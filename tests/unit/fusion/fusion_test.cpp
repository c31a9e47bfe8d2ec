#include "components/fusion/fusion.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "tests/support/real_time_guard.hpp"
#include "tests/unit/fusion/fusion_rig.hpp"

namespace invar::fusion {
namespace {

using testing::Rig;

struct Ends final : Component {
  Output<stage::AxisFeedback> feedback{*this, "feedback"};
  Input<sensing::FusedPosition> fused{*this, "fused"};
  void step(const Tick&) noexcept override {}
};

/// A sinusoid of 100 mm read by an encoder of 1 mm and a velocity sensor with noise: the fused position must be far nearer to
/// the truth than the best that the encoder alone can give, 1 mm / sqrt(12).
TEST(Fusion, IsFarBetterThanTheEncoderAlone) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, 0.002};
  Fusion::Parameters parameters;
  parameters.resolution = 1e-3;
  parameters.largest_velocity = 0.13;
  Fusion fusion{parameters};
  Ends ends;
  ASSERT_TRUE(ends.feedback.connect(*static_cast<InputPort*>(fusion.find_port("feedback"))));
  ASSERT_TRUE(static_cast<OutputPort*>(fusion.find_port("fused"))->connect(ends.fused));
  fusion.configure();
  fusion.activate();
  const double omega = 2 * std::numbers::pi / 5.0;
  double squares = 0.0;
  int count = 0;
  for (std::int64_t k = 0; k < 10'000; ++k) {
    const double t = static_cast<double>(k) * 1e-3;
    const double truth = 0.05 - 0.05 * std::cos(omega * t);
    stage::AxisFeedback sample;
    sample.position(1e-3 * std::round(truth / 1e-3));
    sample.velocity(0.05 * omega * std::sin(omega * t) + noise(random));
    ends.feedback.write(sample);
    fusion.step({Instant{k * 1'000'000}, 1e-3, static_cast<std::uint64_t>(k)});
    if (k < 1000) continue;
    const double error = ends.fused.latest()->position() - truth;
    squares += error * error;
    ++count;
  }
  EXPECT_LT(std::sqrt(squares / count), 0.25 * 1e-3 / std::sqrt(12.0));
}

TEST(Fusion, SaysNothingBeforeItsFirstReading) {
  Fusion::Parameters parameters;
  Fusion fusion{parameters};
  Ends ends;
  ASSERT_TRUE(static_cast<OutputPort*>(fusion.find_port("fused"))->connect(ends.fused));
  fusion.configure();
  fusion.activate();
  fusion.step({Instant{0}, 1e-3, 0});
  EXPECT_EQ(ends.fused.latest(), nullptr);
}

TEST(Fusion, EstimatesHowLateTheVelocityIsAndAlignsIt) {
  for (const double lag : {0.0, 4e-3}) {
    Rig rig;
    rig.lag = lag;
    sensing::FusedPosition fused;
    while (rig.time() < 15.0) fused = rig.step();
    EXPECT_NEAR(fused.lateness()[2], lag, 0.6e-3);
    EXPECT_NEAR(fused.noise()[2], 0.005, 0.0005);  // the noise it was given
  }
}

TEST(Fusion, EstimatesHowLateAPositionIsAndAlignsIt) {
  auto parameters = Rig::parameters_of();
  parameters.sensors[2].delay_sigma = 5e-3;
  Rig rig{parameters};
  constexpr double delay = 4e-3;  // 0.5 mm at the fastest
  double squares = 0.0;
  int count = 0;
  sensing::FusedPosition fused;
  while (rig.time() < 15.0) {
    const double now = rig.time();
    fused = rig.step([&](int sensor, double t, sensing::AxisReading& reading) {
      if (sensor == 1) reading.position(reading.position() - Rig::truth(t) + Rig::truth(t - delay));
      return true;
    });
    if (now < 5.0) continue;
    squares += std::pow(fused.position() - Rig::truth(now), 2);
    ++count;
  }
  EXPECT_NEAR(fused.lateness()[1], delay, 0.3e-3);
  EXPECT_LT(std::sqrt(squares / count), 0.03e-3);
  EXPECT_EQ(fused.live(), 7U);
}

TEST(Fusion, TakesSensorsOfOtherRates) {
  Rig rig;
  double squares = 0.0;
  int count = 0;
  const auto slower = [&](int sensor, double, sensing::AxisReading&) {
    return sensor == 0 || rig.cycle % (sensor == 1 ? 4 : 3) == 0;
  };
  while (rig.time() < 5.0) {
    const double t = rig.time();
    const auto& fused = rig.step(slower);
    if (t < 0.5) continue;
    EXPECT_EQ(fused.live(), 7U) << t;
    squares += std::pow(fused.position() - Rig::truth(t), 2);
    ++count;
  }
  EXPECT_LT(std::sqrt(squares / count), 0.03e-3);
}

TEST(Fusion, SwitchesOffWhatAddsLittleAndOnWhenItIsNeeded) {
  auto parameters = Rig::parameters_of();
  parameters.sensors[2].noise = 2e-3;  // tells nothing beside an encoder of 0.1 mm
  parameters.rest.least_weight = 0.05;
  parameters.rest.after = 0.3;
  parameters.rest.look_again = 2.0;
  Rig rig{parameters};
  bool rested = false;
  while (rig.time() < 1.9) rested = (rig.step().resting() & 2U) != 0U || rested;
  EXPECT_TRUE(rested);
  EXPECT_EQ(rig.ends.fused.latest()->resting(), 2U);
  const auto without_speed = [](int sensor, double, sensing::AxisReading&) { return sensor != 2; };
  while (rig.time() < 1.95) rig.step(without_speed);
  EXPECT_EQ(rig.ends.fused.latest()->resting(), 0U) << "another sensor is gone: all are needed";
}

TEST(Fusion, NeitherAllocatesNorLocksWhateverFails) {
  Rig rig;
  std::int64_t cycle = 0;
  const Rig::Meddle fails = [&](int sensor, double, sensing::AxisReading& reading) {
    if (sensor == 0) ++cycle;
    if (cycle > 500 && cycle < 800 && sensor == 2) return false;
    if (cycle > 1000 && cycle < 1300 && sensor == 0) reading.position(0.0);
    return cycle < 1500 || sensor != 1;
  };
  for (int i = 0; i < 300; ++i) rig.step(fails);
  const support::RealTimeGuard guard;
  for (int i = 0; i < 2000; ++i) rig.step(fails);
  EXPECT_EQ(guard.violations(), 0U);
}

}  // namespace
}  // namespace invar::fusion
