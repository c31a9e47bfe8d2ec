// The thesis's weights: batch and recursive, over selectors, of higher order; its tables 4.1 and 4.2.
#include "core/metrology/fusion/weighted_fusion.hpp"

#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/metrology/fusion/fusion_identification.hpp"
#include "core/numerics/rbf_kernel.hpp"
#include "tests/support/real_time_guard.hpp"
#include "tests/unit/metrology/fusion/fusion_rig.hpp"

namespace invar::metrology {
namespace {

using namespace testing;

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
    recursive.add({sensors(i, 0), sensors(i, 1)}, run.reference(i));
  for (std::size_t k = 0; k < 2; ++k)
    EXPECT_NEAR(recursive.weight(k), batch.weights(static_cast<Eigen::Index>(k)), 1e-3);
  EXPECT_NEAR(recursive.intercept(), batch.intercept, 1e-6);
}

/// Two position sensors on a sinusoid, noise 0.1 mm and 0.03 mm as long as the second is sound, fused by weights that were
/// found then. The second may get noisier and shift.
class AgeingPair {
 public:
  explicit AgeingPair(const WeightLearning& learning) : weighted_{model(), learning} {}
  /// RMS error of the last half of so many seconds [m].
  double run(double seconds, double noise, double shift, bool with_reference) {
    double squares = 0.0;
    int count = 0;
    const double until = time_ + seconds;
    const support::RealTimeGuard guard;
    for (; time_ < until; time_ += dt) {
      const double x = 0.1 * (1.0 - std::cos(2.0 * std::numbers::pi * time_ / 4.0));
      FusionSample sample;
      sample.period = time_ > 0.0 ? dt : 0.0;
      sample.positions = {x + 1e-4 * normal_(random_), x + shift + noise * normal_(random_)};
      if (with_reference) sample.reference = x;
      const FusedPosition fused = weighted_.step(sample);
      largest_change = std::max(largest_change, std::abs(fused.weights[1] - weight));
      weight = fused.weights[1];
      if (time_ < until - 0.5 * seconds) continue;
      squares += std::pow(fused.position - x, 2);
      ++count;
    }
    violations += guard.violations();
    return std::sqrt(squares / count);
  }
  double weight = 0.9;  // of the second sensor
  double largest_change = 0.0;
  std::uint64_t violations = 0;

 private:
  static WeightModel model() {
    std::mt19937 random{5};
    std::normal_distribution<double> normal;
    std::vector<FusionRun> runs;
    for (int r = 0; r < 9; ++r) {
      FusionRun run = record(Rig{}, sinusoid(3.0 + r % 3), 4.0, 0.05 + 0.01 * (r / 3), 9);
      run.velocities.resize(run.time.size(), 0);
      run.positions.resize(run.time.size(), 2);
      for (Eigen::Index i = 0; i < run.time.size(); ++i) {
        run.positions(i, 0) = run.reference(i) + 1e-4 * normal(random);
        run.positions(i, 1) = run.reference(i) + 3e-5 * normal(random);
      }
      runs.push_back(std::move(run));
    }
    return identify_weights(runs);
  }
  WeightedFusion weighted_;
  std::mt19937 random_{7};
  std::normal_distribution<double> normal_;
  double time_ = 0.0;
};

TEST(WeightedFusion, LearnsAgainWhatASensorIsWorthWhileAReferenceIsThere) {
  AgeingPair pair{{.memory = 2.0, .most = 1.0}};
  EXPECT_LT(pair.run(10.0, 3e-5, 0.0, true), 3.2e-5);  // inverse variances: 0.0287 mm
  EXPECT_NEAR(pair.weight, 0.917, 0.03);
  const double before = pair.weight;
  // Six times as noisy: worth 0.236, which leaves 0.087 mm; as if it were still sound it would be 0.165 mm.
  EXPECT_LT(pair.run(20.0, 1.8e-4, 0.0, true), 0.1e-3);
  EXPECT_NEAR(pair.weight, 0.236, 0.09);
  EXPECT_LT(pair.largest_change, 0.02) << "the weight stepped";
  // The reference is gone: what was learnt stays.
  const double learnt = pair.weight;
  EXPECT_LT(pair.run(10.0, 1.8e-4, 0.0, false), 0.1e-3);
  EXPECT_NEAR(pair.weight, learnt, 0.03);
  // It recovers, and so does its weight.
  EXPECT_LT(pair.run(20.0, 3e-5, 0.0, true), 3.2e-5);
  EXPECT_NEAR(pair.weight, before, 0.03);
  EXPECT_EQ(pair.violations, 0U);
}

TEST(WeightedFusion, LearnsNoFurtherThanItsBounds) {
  AgeingPair bound{{.memory = 2.0, .most = 0.2}}, none{{}};
  bound.run(20.0, 1.8e-4, 0.0, true);
  EXPECT_NEAR(bound.weight, 0.917 - 0.2, 0.03);
  none.run(20.0, 1.8e-4, 0.0, true);
  EXPECT_NEAR(none.weight, 0.917, 0.03);
  // A shift of 3 mm of a sensor that weighs 0.9 is taken off by the intercept, 2 mm of it.
  AgeingPair shifted{{.memory = 2.0, .most = 0.0}}, within{{.memory = 2.0, .most = 0.0}};
  EXPECT_NEAR(shifted.run(20.0, 3e-5, 3e-3, true), 0.917 * 3e-3 - 2e-3, 0.1e-3);
  EXPECT_LT(within.run(20.0, 3e-5, 1e-3, true), 0.1e-3);
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

/// The thesis's table as selectors (speed [m/s], noise fraction) and weights; empty where the data are absent.
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

TEST(ThesisTables, AreFittedWithALeaveOneOutErrorOfSixHundredths) {
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
