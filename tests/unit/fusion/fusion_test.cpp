#include "components/fusion/fusion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace invar::fusion {
namespace {

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

}  // namespace
}  // namespace invar::fusion
