// Sensors and methods are found again in recordings whose truth is known.
#include "core/metrology/fusion/fusion_identification.hpp"

#include <gmock/gmock.h>

#include "tests/unit/metrology/fusion/fusion_rig.hpp"

namespace invar::metrology {
namespace {

using namespace testing;

TEST(FusionIdentification, FindsStepOffsetAndCompressionOfTheSensors) {
  const Rig rig;
  std::vector<std::string> open;
  const FusionModel model = identify_sensors(training(rig), {"encoder"}, {"speed"}, &open);
  EXPECT_NEAR(model.positions[0].step, rig.step, 1e-9);
  EXPECT_NEAR(model.positions[0].offset, rig.offset, 0.02e-3);
  EXPECT_NEAR(model.velocities[0].response(0.1), 0.1 * (1.0 - 0.12 * 0.1), 2e-4);
  EXPECT_NEAR(model.velocities[0].response(0.5), 0.5 * (1.0 - 0.12 * 0.5), 3e-3);
  EXPECT_NEAR(model.velocities[0].response(-0.5), -model.velocities[0].response(0.5), 1e-12);
  EXPECT_THAT(open, ::testing::ElementsAre(::testing::HasSubstr("hysteresis of encoder")));
}

TEST(FusionIdentification, FindsHysteresisWhereRunsGoBothWays) {
  Rig rig;
  rig.hysteresis = 0.15e-3;
  std::vector<std::string> open;
  const FusionModel model = identify_sensors(training(rig, true), {"encoder"}, {"speed"}, &open);
  EXPECT_NEAR(model.positions[0].hysteresis, rig.hysteresis, 0.02e-3);
  EXPECT_THAT(open, ::testing::IsEmpty());
}

TEST(FusionIdentification, FindsTheLagOfTheVelocitySensor) {
  Rig rig;
  rig.lag = 6e-3;
  EXPECT_NEAR(model_of(rig).velocities[0].lag, rig.lag, 1.5e-3);
}

TEST(FusionIdentification, FindsHowLateAPositionSensorIs) {
  FusionRun run = record(Rig{}, sinusoid(2.0), 6.0, 0.05, 5);
  run.velocities.resize(run.time.size(), 0);
  run.positions.resize(run.time.size(), 2);
  const auto x = sinusoid(2.0);
  for (Eigen::Index i = 0; i < run.time.size(); ++i) {
    run.positions(i, 0) = x(run.time(i));
    run.positions(i, 1) = x(run.time(i) - 0.01);
  }
  const FusionModel sensors = identify_sensors({run}, {"a", "b"}, {}, nullptr);
  EXPECT_NEAR(sensors.positions[1].delay, 0.01, 2e-4);
}

TEST(FusionIdentification, ChoosesTheObserverByHeldOutRuns) {
  const FusionFit fit = identify_fusion(training(Rig{}), {"encoder"}, {"speed"}, {});
  EXPECT_EQ(fit.method, FusionMethod::observer);
  EXPECT_LT(fit.observer_rms, 0.5 * fit.weights_rms);
}

TEST(FusionIdentification, ChoosesTheWeightsWhereTheStructureDoesNotHold) {
  // Two continuous sensors whose errors are opposite and slow: their mean is exact, no structure of one sensor says so.
  std::mt19937 random{6};
  std::uniform_real_distribution<double> phase{0.0, 6.28};
  std::vector<FusionRun> runs;
  for (int r = 0; r < 9; ++r) {
    FusionRun run = record(Rig{}, sinusoid(3.0 + 0.2 * r), 6.0, 0.05, 5);
    run.velocities.resize(run.time.size(), 0);
    run.positions.resize(run.time.size(), 2);
    const double at = phase(random);
    for (Eigen::Index i = 0; i < run.time.size(); ++i) {
      const double error = 3e-4 * std::sin(2.0 * run.time(i) + at) + 1e-6 * std::sin(1e4 * run.time(i));
      run.positions(i, 0) = run.reference(i) + error;
      run.positions(i, 1) = run.reference(i) - error;
    }
    runs.push_back(std::move(run));
  }
  const FusionFit fit = identify_fusion(runs, {"a", "b"}, {}, {});
  EXPECT_EQ(fit.method, FusionMethod::weights);
  EXPECT_LT(fit.weights_rms, 0.2 * fit.observer_rms);
}

TEST(NoiseBySpeed, IsFoundWhereTheNoiseFollowsTheSpeed) {
  // Deviation 2 mm/s + 0.05 v: the window of a run knows it late, the speed at once.
  std::mt19937 random{3};
  std::normal_distribution<double> normal;
  std::vector<FusionRun> runs;
  for (int r = 0; r < 12; ++r) {
    FusionRun run = record(Rig{}, sinusoid(1.5 + 0.3 * r), 4.0, 0.0, 40);
    for (Eigen::Index i = 1; i + 1 < run.time.size(); ++i) {
      const double v = (run.reference(i + 1) - run.reference(i - 1)) / (2.0 * dt);
      run.velocities(i, 0) = v + (0.002 + 0.05 * std::abs(v)) * normal(random);
    }
    runs.push_back(std::move(run));
  }
  const NoiseBySpeed noise = identify_noise_by_speed(runs);
  for (const double v : {0.05, 0.1, 0.2}) EXPECT_NEAR(noise(v), 0.002 + 0.05 * v, 0.15 * (0.002 + 0.05 * v));
  for (std::size_t k = 1; k < noise.speed.size(); ++k)
    EXPECT_GE(noise.log_deviation[k], noise.log_deviation[k - 1]);
}

TEST(NoiseBySpeed, IsWhatTheWeightsAreLookedUpByWhileItRuns) {
  // Noise that grows with the speed: by the model at once, over a window when it has passed.
  const auto run_of = [](double period, unsigned seed) {
    std::mt19937 random{seed};
    std::normal_distribution<double> normal;
    FusionRun run = record(Rig{}, sinusoid(period), 2.0 * period, 0.0, seed);
    for (Eigen::Index i = 1; i + 1 < run.time.size(); ++i) {
      const double v = (run.reference(i + 1) - run.reference(i - 1)) / (2.0 * dt);
      run.velocities(i, 0) = v + (0.002 + 0.05 * std::abs(v)) * normal(random);
    }
    run.noise_level.resize(0);
    return run;
  };
  std::vector<FusionRun> runs;
  for (unsigned r = 0; r < 12; ++r) runs.push_back(run_of(1.5 + 0.3 * r, 60 + r));
  double off[2];  // RMS, relative, by the speed and over a window
  for (const bool by_speed : {true, false}) {
    WeightOptions options;
    options.noise_by_speed = by_speed;
    WeightedFusion weighted{identify_weights(runs, options)};
    const FusionRun unseen = run_of(2.3, 99);
    const auto fused = fuse(weighted, unseen);
    double squares = 0.0;
    const Eigen::Index half = unseen.time.size() / 2;
    for (Eigen::Index i = half; i < unseen.time.size(); ++i) {
      const double v = std::abs(0.1 * 2.0 * std::numbers::pi / 2.3 *
                                std::sin(2.0 * std::numbers::pi * unseen.time(i) / 2.3));
      squares += std::pow(fused[static_cast<std::size_t>(i)].noise[1] / (0.002 + 0.05 * v) - 1.0, 2);
    }
    off[by_speed ? 0 : 1] = std::sqrt(squares / static_cast<double>(unseen.time.size() - half));
  }
  std::printf("noise off by %.0f %% RMS by the speed, %.0f %% over a window\n", 100.0 * off[0],
              100.0 * off[1]);
  EXPECT_LT(off[0], 0.3);
  EXPECT_LT(off[0], 0.5 * off[1]);
}

TEST(EstimatedNoiseLevel, IsTheLevelThatWasPutIn) {
  for (const double level : {0.05, 0.3, 1.0})
    EXPECT_NEAR(estimated_noise_level(record(Rig{}, sinusoid(3.0), 6.0, level, 2).velocities.col(0)), level,
                0.15 * level);
}

}  // namespace
}  // namespace invar::metrology
