// Encoders that stick and are passed by the axis: at rest, at a reversal, and slow ones that jump back. Truth in closed form.
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <random>
#include <string>
#include <utility>

#include "core/metrology/fusion/fusion_observer.hpp"
#include "core/metrology/fusion/weight_identification.hpp"
#include "core/metrology/fusion/weighted_fusion.hpp"
#include "tests/unit/metrology/fusion/fusion_rig.hpp"

namespace invar::metrology {
namespace {

using namespace testing;

/// A seed that is printed, and numbers from it.
struct Random {
  unsigned seed = std::getenv("INVAR_SEED") != nullptr
                      ? static_cast<unsigned>(std::strtoul(std::getenv("INVAR_SEED"), nullptr, 10))
                      : std::random_device{}();
  std::mt19937 engine{seed};
  Random() { std::cout << "INVAR_SEED=" << seed << '\n'; }
  double between(double a, double b) { return std::uniform_real_distribution{a, b}(engine); }
};

/// Errors and stated sigmas of many runs, from where the sensor failed, beside the velocity sensor in hindsight.
struct Score {
  double squares = 0.0, reckoned = 0.0, worst = 0.0;
  int count = 0, covered = 0;

  /// `from` to `to`: the rows where the encoder is stuck. Each run counts alike, however long it is.
  void add(const Rig& rig, const FusionRun& run, const std::vector<FusedPosition>& fused, Eigen::Index from,
           Eigen::Index to) {
    double way = run.reference(0);
    for (Eigen::Index i = 1; i < to; ++i) {
      const double reading = run.velocities(i, 0);
      way += dt * reading / (1.0 - rig.compression * std::min(1.0, std::abs(reading)));
      if (i < from) continue;
      const FusedPosition& at = fused[static_cast<std::size_t>(i)];
      const double error = std::abs(at.position - run.reference(i));
      squares += error * error;
      reckoned += std::pow(way - run.reference(i), 2);
      worst = std::max(worst, error);
      covered += error <= 3.0 * at.sigma ? 1 : 0;
      ++count;
    }
  }
  /// Run `k` with its encoder stuck from row `from` to the end, where nobody must believe it.
  void add_stuck(const Rig& rig, const FusionModel& model, FusionRun run, Eigen::Index from, int k) {
    const double held = run.positions(from, 0);
    run.positions.col(0).tail(run.time.size() - from).setConstant(held);
    FusionObserver observer{model};
    const auto fused = fuse(observer, run);
    add(rig, run, fused, from, run.time.size());
    EXPECT_EQ(fused.back().live & 1U, 0U) << "run " << k << ": the stuck encoder is believed at the end";
  }
  /// The fusion knew the position when the sensor stuck, up to its cell; the velocity sensor alone sums its noise from the
  /// start of the run.
  void expect_honest(const Rig& rig) const {
    const double rms = std::sqrt(squares / count), healthy = std::sqrt(reckoned / count);
    const double share = static_cast<double>(covered) / count;
    std::cout << "stuck: rms " << 1e3 * rms << " mm, velocity sensor alone " << 1e3 * healthy << " mm, worst "
              << 1e3 * worst << " mm, within three sigmas " << 100.0 * share << " %\n";
    EXPECT_LT(rms, 1.5 * healthy);
    EXPECT_LT(worst, 1.5 * rig.step + 8.0 * healthy);
    EXPECT_GT(share, 0.95);
  }
};

/// Goes to `to` within `arrive`, rests until `leave`, swings around that place.
auto rests_and_swings(double to, double arrive, double leave, double amplitude, double period) {
  return [=](double t) {
    if (t <= 0.0) return 0.0;
    if (t < arrive) return 0.5 * to * (1.0 - std::cos(std::numbers::pi * t / arrive));
    const double s = std::max(0.0, t - leave);
    return to + amplitude * std::sin(2.0 * std::numbers::pi * s / period) * (1.0 - std::exp(-10.0 * s * s));
  };
}

TEST(FusionPassed, AnEncoderThatStuckAtRestIsPassedFromBothSides) {
  Random random;
  const Rig rig;
  const FusionModel model = model_of(rig);
  Score score;
  for (int k = 0; k < 40; ++k) {
    const double arrive = random.between(0.8, 2.0), leave = arrive + random.between(0.3, 3.0);
    const double way = random.between(0.03, 0.1) * (k % 2 == 0 ? 1.0 : -1.0);
    FusionRun run = record(rig, rests_and_swings(0.1, arrive, leave, way, random.between(2.0, 5.0)),
                           leave + 8.0, std::exp(random.between(std::log(0.03), std::log(0.3))),
                           static_cast<unsigned>(random.engine()));
    const auto from = static_cast<Eigen::Index>(random.between(arrive, leave) / dt);
    score.add_stuck(rig, model, std::move(run), from, k);
  }
  score.expect_honest(rig);
}

TEST(FusionPassed, AnEncoderThatSticksAtTheMomentOfReversal) {
  Random random;
  const Rig rig;
  const FusionModel model = model_of(rig);
  Score score;
  for (int k = 0; k < 40; ++k) {
    const double period = random.between(2.0, 6.0);
    FusionRun run =
        record(rig, sinusoid(period), 3.0 * period, std::exp(random.between(std::log(0.03), std::log(0.3))),
               static_cast<unsigned>(random.engine()));
    // The cell in which it turns, entered before: stuck from then on is stuck at the reversal.
    const double turn = 0.5 * period * std::floor(random.between(1.0, 4.0));
    const auto from = static_cast<Eigen::Index>((turn + random.between(-0.01, 0.01)) / dt);
    score.add_stuck(rig, model, std::move(run), from, k);
  }
  score.expect_honest(rig);
}

TEST(FusionPassed, ASlowEncoderThatSticksAndJumpsBack) {
  Random random;
  const Rig rig;
  const FusionModel model = model_of(rig);
  constexpr Eigen::Index each = 10;  // it is read at 50 Hz, the velocity sensor at 500 Hz
  Score score;
  for (int k = 0; k < 40; ++k) {
    FusionRun run = record(rig, sinusoid(random.between(2.0, 6.0)), 12.0,
                           std::exp(random.between(std::log(0.03), std::log(0.3))),
                           static_cast<unsigned>(random.engine()));
    const auto from = static_cast<Eigen::Index>(random.between(1.0, 6.0) / dt);
    const auto to = from + static_cast<Eigen::Index>(random.between(0.4, 3.0) / dt);
    const double held = run.positions(from / each * each, 0);
    run.positions.col(0).segment(from, to - from).setConstant(held);
    FusionObserver observer{model};
    std::vector<FusedPosition> fused;
    for (Eigen::Index i = 0; i < run.time.size(); ++i) {
      FusionSample sample;
      sample.period = i > 0 ? dt : 0.0;
      sample.positions[0] = run.positions(i, 0);
      sample.velocities[0] = run.velocities(i, 0);
      sample.silent = i % each == 0 ? 0U : 1U;
      fused.push_back(observer.step(sample));
    }
    score.add(rig, run, fused, from, to);
    // It is back with its third reading: the velocity sensor led to where it jumped.
    double back = 0.0;
    for (Eigen::Index i = to + 3 * each; i < run.time.size(); ++i)
      back = std::max(back, std::abs(fused[static_cast<std::size_t>(i)].position - run.reference(i)));
    EXPECT_LT(back, 2.0 * rig.step) << "run " << k << ": after it jumped back at " << run.time(to) << " s";
    EXPECT_EQ(fused.back().live & 1U, 1U) << "run " << k << ": it did not come back";
  }
  score.expect_honest(rig);
}

TEST(FusionPassed, WeightsTakeAnEncoderThatStuckBackOnlyWhenItCounts) {
  Random random;
  const Rig rig;
  WeightModel weights = identify_weights(training(rig));
  weights.known = model_of(rig).positions;
  for (int k = 0; k < 10; ++k) {
    const double period = random.between(2.0, 6.0);
    FusionRun run = record(rig, sinusoid(period), 4.0 * period, random.between(0.03, 0.3),
                           static_cast<unsigned>(random.engine()));
    const auto row = [&](double periods) { return static_cast<Eigen::Index>(periods * period / dt); };
    // Stuck where it turns, from the first period to the third, when the true position has passed it twice.
    run.positions.col(0).segment(row(1.0), row(2.0)).setConstant(run.positions(row(1.0), 0));
    WeightedFusion fusion{weights};
    const auto fused = fuse(fusion, run);
    const auto lives = [&](Eigen::Index i) { return (fused[static_cast<std::size_t>(i)].live & 1U) != 0U; };
    EXPECT_TRUE(lives(row(0.9)));
    for (Eigen::Index i = row(1.3); i < row(2.9); ++i) ASSERT_FALSE(lives(i)) << "run " << k << ", row " << i;
    EXPECT_TRUE(lives(row(3.4))) << "run " << k;
  }
}

}  // namespace
}  // namespace invar::metrology
