// Fusion of a coarse encoder and a noisy velocity sensor whose truth is known; the seed's tables 4.1 and 4.2.
#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <sstream>

#include "core/metrology/fusion_identification.hpp"
#include "core/metrology/fusion_observer.hpp"
#include "core/numerics/rbf_kernel.hpp"

namespace invar::metrology {
namespace {

constexpr double dt = 0.002;

/// What the sensors of a test are; the identification must find it out.
struct Rig {
  double step = 2e-3;
  double offset = 0.3e-3;  // the encoder reads this much low
  double hysteresis = 0.0;
  double compression = 0.12;  // gain 1 - compression |v|
  double lag = 0.0;
};

/// Samples `position(t)` over `duration` with both sensors; noise is uniform, of the largest reading.
template <class Position>
FusionRun record(const Rig& rig, Position position, double duration, double noise_level, unsigned seed) {
  std::mt19937 random{seed};
  std::uniform_real_distribution<double> uniform{-1.0, 1.0};
  const auto n = static_cast<Eigen::Index>(duration / dt) + 1;
  FusionRun run{Eigen::VectorXd(n),
                Eigen::VectorXd(n),
                Eigen::MatrixXd(n, 1),
                Eigen::MatrixXd(n, 1),
                Eigen::VectorXd::Constant(n, noise_level),
                {}};
  Eigen::VectorXd clean(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = dt * static_cast<double>(i);
    run.time(i) = t;
    run.reference(i) = position(t);
    const double v = (position(t - rig.lag + 1e-5) - position(t - rig.lag - 1e-5)) / 2e-5;
    const double way = v > 0.0 ? 1.0 : -1.0;
    run.positions(i, 0) = rig.step * std::round((position(t) - rig.offset - way * rig.hysteresis) / rig.step);
    clean(i) = v * (1.0 - rig.compression * std::abs(v));
  }
  const double largest = clean.cwiseAbs().maxCoeff();
  for (Eigen::Index i = 0; i < n; ++i)
    run.velocities(i, 0) = clean(i) + noise_level * largest * uniform(random);
  return run;
}

/// From rest to constant speed with 2 m/s2.
auto constant_speed(double speed) {
  return [speed](double t) {
    const double ramp = speed / 2.0;
    if (t <= 0.0) return 0.0;
    return t < ramp ? t * t : speed * (t - 0.5 * ramp);
  };
}
auto sinusoid(double period) {
  return [period](double t) {
    return t <= 0.0 ? 0.0 : 0.1 * (1.0 - std::cos(2.0 * std::numbers::pi * t / period));
  };
}

std::vector<FusionRun> training(const Rig& rig, bool both_ways = false) {
  std::vector<FusionRun> runs;
  unsigned seed = 1;
  for (const double noise : {0.05, 0.2, 1.0})
    for (const double speed : {0.02, 0.04, 0.1, 0.2, 0.4, 0.6}) {
      const double duration = std::min(2.0, 0.2 / speed);
      if (both_ways) {
        const auto forth = constant_speed(speed);
        runs.push_back(record(
            rig, [&](double t) { return t < duration ? forth(t) : forth(duration) - forth(t - duration); },
            2.0 * duration, noise, seed++));
      } else {
        runs.push_back(record(rig, constant_speed(speed), duration, noise, seed++));
      }
    }
  return runs;
}

double rms(FusionEstimator& estimator, const FusionRun& run, Eigen::Index from = 0) {
  const auto fused = fuse(estimator, run);
  double squares = 0.0;
  for (Eigen::Index i = from; i < run.time.size(); ++i)
    squares += std::pow(fused[static_cast<std::size_t>(i)].position - run.reference(i), 2);
  return std::sqrt(squares / static_cast<double>(run.time.size() - from));
}

double encoder_rms(const FusionRun& run, Eigen::Index from = 0) {
  return std::sqrt((run.positions.col(0) - run.reference).tail(run.time.size() - from).squaredNorm() /
                   static_cast<double>(run.time.size() - from));
}

FusionModel model_of(const Rig& rig) {
  return identify_sensors(training(rig), {"encoder"}, {"speed"}, nullptr);
}

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

TEST(FusionObserver, IsFarBetterThanTheEncoderOnTheSeedsSinusoids) {
  const Rig rig;
  FusionObserver observer{model_of(rig)};
  // Section 10 at 0.1 ms sampling: interval observer 0.024, 0.063, 0.098, 0.168 mm against 0.72 of the encoder.
  for (const auto& [noise, bar] : {std::pair{0.05, 0.1e-3}, {0.3, 0.15e-3}, {0.5, 0.2e-3}, {1.0, 0.3e-3}})
    for (const double period : {3.0, 4.0, 5.0, 1.05}) {
      const FusionRun run = record(rig, sinusoid(period), 2.0 * period, noise, 77);
      EXPECT_LT(rms(observer, run), period > 2.0 ? bar : 2.0 * bar) << noise << ' ' << period;
      EXPECT_LT(rms(observer, run), 0.5 * encoder_rms(run)) << noise << ' ' << period;
    }
}

TEST(FusionObserver, SurvivesNoiseTenTimesTheReading) {
  const Rig rig;
  FusionObserver observer{model_of(rig)};
  for (unsigned seed = 1; seed <= 6; ++seed)
    for (const double noise : {3.0, 10.0}) {
      const FusionRun run = record(rig, sinusoid(5.0), 10.0, noise, seed);
      EXPECT_LT(rms(observer, run), 0.7 * encoder_rms(run)) << noise << ", seed " << seed;
    }
}

TEST(FusionObserver, KnowsItsError) {
  const Rig rig;
  FusionObserver observer{model_of(rig)};
  for (const double noise : {0.05, 0.5}) {
    const FusionRun run = record(rig, sinusoid(4.0), 8.0, noise, 5);
    const auto fused = fuse(observer, run);
    int covered = 0;
    for (Eigen::Index i = 0; i < run.time.size(); ++i) {
      const auto& at = fused[static_cast<std::size_t>(i)];
      covered += std::abs(at.position - run.reference(i)) <= 2.5 * at.sigma ? 1 : 0;
    }
    EXPECT_GT(static_cast<double>(covered) / static_cast<double>(run.time.size()), 0.85) << noise;
  }
}

TEST(FusionObserver, NeedsNoNoiseLevelColumn) {
  const Rig rig;
  FusionObserver observer{model_of(rig)};
  FusionRun run = record(rig, sinusoid(4.0), 8.0, 0.4, 9);
  const double given = rms(observer, run);
  run.noise_level.resize(0);
  EXPECT_LT(rms(observer, run), 1.1 * given);
}

struct Fault {
  const char* name;
  void (*happen)(FusionRun&, Eigen::Index);
  int sensor;  // that must have lost its weight at the end: 0 encoder, 1 velocity, -1 none
  double bar;  // RMS after the fault [m]
};

class FusionFault : public ::testing::TestWithParam<Fault> {};

TEST_P(FusionFault, TakesTheWeightFromTheSensorThatFails) {
  const Rig rig;
  FusionObserver observer{model_of(rig)};
  for (const double noise : {0.05, 0.2})
    for (const double at : {1.1, 1.7, 2.3}) {
      FusionRun run = record(rig, sinusoid(4.0), 8.0, noise, 21);
      const auto row = static_cast<Eigen::Index>(at / dt);
      GetParam().happen(run, row);
      EXPECT_LT(rms(observer, run, row), GetParam().bar) << "noise " << noise << ", at " << at << " s";
      const FusedPosition last = fuse(observer, run).back();
      for (int k = 0; k < 2; ++k) {
        if (k == GetParam().sensor) {
          EXPECT_EQ(last.weights[static_cast<std::size_t>(k)], 0.0);
        } else {
          EXPECT_GT(last.weights[static_cast<std::size_t>(k)], 0.0);
        }
      }
    }
}

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
INSTANTIATE_TEST_SUITE_P(
    All, FusionFault,
    ::testing::Values(
        Fault{"velocity dies",
              [](FusionRun& r, Eigen::Index i) { r.velocities.bottomRows(r.time.size() - i).setZero(); }, 1,
              0.5e-3},
        Fault{"velocity sticks",
              [](FusionRun& r, Eigen::Index i) {
                const double held = r.velocities(i, 0);
                r.velocities.bottomRows(r.time.size() - i).setConstant(held);
              },
              1, 0.5e-3},
        Fault{"velocity goes missing",
              [](FusionRun& r, Eigen::Index i) {
                r.velocities.bottomRows(r.time.size() - i).setConstant(nothing);
              },
              1, 0.5e-3},
        Fault{"encoder sticks",
              [](FusionRun& r, Eigen::Index i) {
                const double held = r.positions(i, 0);
                r.positions.bottomRows(r.time.size() - i).setConstant(held);
              },
              0, 3e-3},
        Fault{"encoder goes missing",
              [](FusionRun& r, Eigen::Index i) {
                r.positions.bottomRows(r.time.size() - i).setConstant(nothing);
              },
              0, 3e-3},
        Fault{"encoder jumps for 20 ms",
              [](FusionRun& r, Eigen::Index i) { r.positions.middleRows(i, 10).array() += 0.03; }, -1,
              0.3e-3},
        Fault{"velocity spikes",
              [](FusionRun& r, Eigen::Index i) {
                for (Eigen::Index k = i; k < r.time.size(); k += 97) r.velocities(k, 0) += 3.0;
              },
              -1, 0.3e-3}),
    [](const ::testing::TestParamInfo<Fault>& fault) {
      std::string name = fault.param.name;
      std::replace(name.begin(), name.end(), ' ', '_');
      return name;
    });

TEST(FusionObserver, BelievesTheEncoderThatMovesAndNotTheOneThatStands) {
  // Two encoders and a velocity of 300 % noise, which is no witness for either.
  FusionModel model;
  model.position_names = {"fine", "coarse"};
  model.velocity_names = {"speed"};
  model.positions = {{2e-3, 0.0, 0.0, 0.0, 2e-6, 0}, {5e-3, 0.0, 0.0, 0.0, 5e-6, 0}};
  model.velocities.resize(1);
  model.start_sigma = 1e-4;
  FusionObserver observer{model};
  for (const Eigen::Index stuck : {0, 1}) {
    FusionRun run = record(Rig{.offset = 0.0, .compression = 0.0}, sinusoid(4.0), 8.0, 3.0, 4);
    run.positions.conservativeResize(Eigen::NoChange, 2);
    run.positions.col(1) = 5e-3 * (run.reference.array() / 5e-3).round();
    const double held = run.positions(1200, stuck);
    run.positions.col(stuck).tail(run.time.size() - 1200).setConstant(held);
    EXPECT_LT(rms(observer, run, 1200), 1.5e-3);
    EXPECT_EQ(fuse(observer, run).back().weights[static_cast<std::size_t>(stuck)], 0.0);
  }
}

TEST(FusionObserver, TakesBackWhatAContinuousSensorToldAfterItDied) {
  FusionModel model;
  model.position_names = {"analogue"};
  model.velocity_names = {"speed"};
  model.positions = {{0.0, 0.0, 0.0, 0.0, 3e-4, 0}};
  model.velocities.resize(1);
  model.start_sigma = 3e-4;
  FusionObserver observer{model};
  FusionRun run = record(Rig{.offset = 0.0, .compression = 0.0}, sinusoid(4.0), 8.0, 0.05, 4);
  std::mt19937 random{5};
  std::normal_distribution<double> normal;
  for (Eigen::Index i = 0; i < run.time.size(); ++i)
    run.positions(i, 0) = run.reference(i) + 3e-4 * normal(random);
  const double held = run.positions(1200, 0);
  run.positions.bottomRows(run.time.size() - 1200).setConstant(held);
  EXPECT_LT(rms(observer, run, 1200), 1e-3);  // the velocity alone drifts by half a millimetre
  EXPECT_EQ(fuse(observer, run).back().weights[0], 0.0);
}

TEST(WeightedFusion, RecursiveWeightsEqualBatchWeights) {
  const FusionRun run = record(Rig{}, constant_speed(0.1), 1.9, 0.2, 3);
  Eigen::MatrixXd sensors(run.time.size(), 2);
  sensors.col(0) = run.positions;
  double x = 0.0;
  for (Eigen::Index i = 0; i < run.time.size(); ++i) sensors(i, 1) = x += run.velocities(i, 0) * dt;
  const WeightFit batch = fit_weights(sensors, run.reference);
  EXPECT_NEAR(batch.weights.sum(), 1.0, 1e-12);
  RecursiveWeights recursive{2};
  for (Eigen::Index i = 0; i < run.time.size(); ++i)
    recursive.add(sensors.row(i).transpose(), run.reference(i));
  EXPECT_TRUE(recursive.weights().isApprox(batch.weights, 1e-3)) << recursive.weights().transpose();
  EXPECT_NEAR(recursive.intercept(), batch.intercept, 1e-6);
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

/// Error of whichever weights a fit chose, on runs that it never saw.
double unseen_rms(const FusionFit& fit, const std::vector<FusionRun>& runs) {
  WeightedFusion weighted{fit.weights};
  double squares = 0.0;
  for (const FusionRun& run : runs) squares += std::pow(rms(weighted, run), 2);
  return std::sqrt(squares / static_cast<double>(runs.size()));
}

/// Two position sensors that are curved alike, so that no weights can help, at random constant speeds.
std::vector<FusionRun> curved(double curvature, int count, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, 2e-5};
  std::uniform_real_distribution<double> speeds{0.1, 0.3};
  std::vector<FusionRun> runs;
  for (int r = 0; r < count; ++r) {
    const double speed = speeds(random);
    FusionRun run = record(Rig{}, constant_speed(speed), 0.2 / speed, 0.05, seed + static_cast<unsigned>(r));
    run.velocities.resize(run.time.size(), 0);
    run.noise_level.setConstant(0.05);
    run.positions.resize(run.time.size(), 2);
    for (Eigen::Index i = 0; i < run.time.size(); ++i) {
      const double x = run.reference(i);
      run.positions(i, 0) = x + curvature * (x - 0.1) * (x - 0.1) + noise(random);
      run.positions(i, 1) = x + curvature * (x - 0.1) * (x - 0.1) + 3.0 * noise(random);
    }
    runs.push_back(std::move(run));
  }
  return runs;
}

TEST(NonlinearFusion, IsChosenWhereItHelpsAndNeverWorseThanLinearOnUnseenRuns) {
  FusionOptions options;
  options.polynomial = true;
  int taken = 0;
  for (unsigned seed = 100; seed < 104; ++seed)
    for (const double curvature : {0.0, 0.05}) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", curvature " + std::to_string(curvature));
      const auto train = curved(curvature, 9, seed);
      const auto unseen = curved(curvature, 9, seed + 1000);
      const FusionFit linear = identify_fusion(train, {"a", "b"}, {}, {});
      const FusionFit nonlinear = identify_fusion(train, {"a", "b"}, {}, options);
      EXPECT_EQ(linear.degree, 1);
      EXPECT_LE(unseen_rms(nonlinear, unseen), 1.02 * unseen_rms(linear, unseen));
      if (curvature > 0.0) {
        EXPECT_GE(nonlinear.degree, 2);
        EXPECT_LT(unseen_rms(nonlinear, unseen), 0.7 * unseen_rms(linear, unseen));
      } else if (nonlinear.degree > 1) {
        ++taken;
      }
    }
  EXPECT_LE(taken, 1) << "an order above one is taken where nothing is curved";
}

TEST(NonlinearFusion, HoldsAllMonomialsUpToItsOrder) {
  // C(variables + degree, degree) of them; two variables of degree two: 1, m, d, mm, md, dd.
  EXPECT_EQ(monomials(2, 2).size(), 6U);
  EXPECT_EQ(monomials(3, 3).size(), 20U);
  EXPECT_EQ(monomials(7, 4).size(), 330U);
  std::vector<double> values;
  for (const Powers& powers : monomials(2, 2)) values.push_back(monomial(powers, {3.0, 5.0}));
  EXPECT_THAT(values, ::testing::UnorderedElementsAre(1.0, 3.0, 5.0, 9.0, 15.0, 25.0));
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

TEST(WeightedFusion, WeightsFollowAFurtherAttribute) {
  // Analogue sensor b is exact at load 0 and useless at load 1; a is the same always.
  std::mt19937 random{8};
  std::normal_distribution<double> normal;
  std::vector<FusionRun> runs;
  for (int r = 0; r < 16; ++r) {
    const double load = (r % 4) / 3.0;
    FusionRun run = record(Rig{}, constant_speed(0.05 + 0.02 * (r / 4)), 2.0, 0.05, 9);
    run.velocities.resize(run.time.size(), 0);
    run.positions.resize(run.time.size(), 2);
    run.selector = Eigen::VectorXd::Constant(run.time.size(), load);
    for (Eigen::Index i = 0; i < run.time.size(); ++i) {
      run.positions(i, 0) = run.reference(i) + 1e-4 * normal(random);
      run.positions(i, 1) = run.reference(i) + (1e-5 + 3e-4 * load) * normal(random);
    }
    runs.push_back(std::move(run));
  }
  const WeightModel model = identify_weights(runs);
  const auto weight_of_b = [&](double load) {
    return weights_at(model, Eigen::Vector3d{0.08, 0.05, load})(1);
  };
  // Inverse variances: 1 / (1 + (b / a)^2).
  EXPECT_NEAR(weight_of_b(0.0), 0.99, 0.05);
  EXPECT_NEAR(weight_of_b(1.0 / 3.0), 1.0 / (1.0 + 1.21), 0.08);
  EXPECT_NEAR(weight_of_b(1.0), 1.0 / (1.0 + 9.61), 0.05);
  WeightedFusion weighted{model};
  EXPECT_LT(rms(weighted, runs[0]), 2e-5);
  EXPECT_LT(rms(weighted, runs[3]), 1.05e-4);
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

TEST(FusionObserver, FollowsTheDriftOfItsSensorsOverALongTime) {
  // Half an hour of printing: the tachometer's offset drifts by 20 mm/s, its gain by 4 %. Half a second at rest each 5 s.
  FusionModel model;
  model.position_names = {"encoder"};
  model.velocity_names = {"speed"};
  model.positions = {{2e-3, 0.0, 0.0, 0.0, 2e-6, 0}};
  model.velocities.resize(1);
  model.velocities[0].largest = 0.13;
  model.start_sigma = 1e-4;
  FusionObserver observer{model};
  std::mt19937 random{12};
  std::uniform_real_distribution<double> uniform{-1.0, 1.0};
  constexpr double step = 0.004, whole = 1800.0;
  double early = 0.0, late = 0.0;
  FusionSample sample;
  for (int k = 0; k * step < whole; ++k) {
    const double t = k * step;
    const double phase = std::min(std::fmod(t, 5.0), 4.5) / 4.5;
    const double x = 0.05 * (1.0 - std::cos(2.0 * std::numbers::pi * phase));
    const double v =
        phase < 1.0 ? 0.05 * 2.0 * std::numbers::pi / 4.5 * std::sin(2.0 * std::numbers::pi * phase) : 0.0;
    sample.period = k == 0 ? 0.0 : step;
    sample.positions[0] = 2e-3 * std::round(x / 2e-3);
    sample.velocities[0] = v * (1.0 + 0.04 * t / whole) + 0.02 * t / whole + 0.1 * 0.07 * uniform(random);
    const double error = observer.step(sample).position - x;
    if (t > 60.0 && t < 260.0) early += error * error;
    if (t > whole - 200.0) late += error * error;
  }
  EXPECT_LT(std::sqrt(late), 1.3 * std::sqrt(early)) << std::sqrt(late * step / 200.0);
  EXPECT_LT(std::sqrt(late * step / 200.0), 0.15e-3);
}

TEST(EstimatedNoiseLevel, IsTheLevelThatWasPutIn) {
  for (const double level : {0.05, 0.3, 1.0})
    EXPECT_NEAR(estimated_noise_level(record(Rig{}, sinusoid(3.0), 6.0, level, 2).velocities.col(0)), level,
                0.15 * level);
}

/// The seed's table as selectors (speed [m/s], noise fraction) and weights; empty where the data are absent.
bool read_table(const std::string& name, Eigen::MatrixXd& selectors, Eigen::VectorXd& weights) {
  const char* shared = std::getenv("INVAR_SHARED");
  const std::filesystem::path folder =
      shared != nullptr ? shared : std::string{INVAR_SOURCE_DIR} + "/../shared";
  std::ifstream file{folder / "seed" / name};
  if (!file) return false;
  std::vector<double> speeds{0.04, 0.10, 0.20, 0.30, 0.40, 0.50, 0.60};
  selectors.resize(2, 49);
  weights.resize(49);
  std::string line;
  std::getline(file, line);
  Eigen::Index k = 0;
  while (std::getline(file, line)) {
    std::istringstream cells{line};
    std::string cell;
    std::getline(cells, cell, ',');
    const double noise = std::stod(cell) / 100.0;
    for (const double speed : speeds) {
      std::getline(cells, cell, ',');
      selectors.col(k) << speed, noise;
      weights(k++) = std::stod(cell);
    }
  }
  return k == 49;
}

TEST(SeedTables, AreFittedWithALeaveOneOutErrorOfSixHundredths) {
  for (const char* name : {"table4_1_k1_velocity_sensor_weight.csv", "table4_2_k2_encoder_weight.csv"}) {
    Eigen::MatrixXd selectors;
    Eigen::VectorXd weights;
    if (!read_table(name, selectors, weights)) {
      std::cout << name << " is not here (set INVAR_SHARED): nothing to compare with\n";
      continue;
    }
    numerics::KernelOptions options;
    options.input_scale = {0.2, 5.7};
    EXPECT_LE(numerics::fit_kernel(selectors, weights, options).leave_one_out_rms(), 0.06) << name;
  }
}

}  // namespace
}  // namespace invar::metrology
