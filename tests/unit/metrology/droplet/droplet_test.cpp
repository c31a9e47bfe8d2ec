// Droplet trajectories: golden numbers, recovery of known parameters, what one height leaves open.
#include "core/metrology/droplet/droplet_trajectory.hpp"

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>

#include "core/metrology/droplet/trajectory_tracker.hpp"

namespace invar::metrology {
namespace {

constexpr double degree = std::numbers::pi / 180.0;

DropletTrajectory thesis_trajectory() {
  DropletTrajectory path;
  path.placement << 2.0e-6, 118.2e-6;
  const double tilt = 0.304 * degree;
  const double azimuth = 0.9739 * degree;
  path.slope << std::tan(tilt) * std::cos(azimuth), std::tan(tilt) * std::sin(azimuth);
  return path;
}

/// Droplets at each height with scatter s0 and s1 per height; every `satellite`-th one a satellite (0: none).
Droplets print(const DropletTrajectory& path, const std::vector<double>& heights, int each, double s0,
               double s1, int satellite, unsigned seed, double stage_speed = 0.0) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  const auto n = static_cast<Eigen::Index>(heights.size()) * each;
  Droplets drops{Eigen::Matrix2Xd(2, n), Eigen::Matrix2Xd(2, n), Eigen::VectorXd(n), {}, Eigen::VectorXd(n)};
  if (stage_speed > 0.0) drops.stage_velocity = Eigen::Matrix2Xd::Zero(2, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double h = heights[static_cast<std::size_t>(i / each)];
    drops.target.col(i) << 1e-3 * static_cast<double>(i % 10), 1e-3 * static_cast<double>(i / 10);
    drops.height(i) = h;
    Eigen::Vector2d velocity = Eigen::Vector2d::Zero();
    if (stage_speed > 0.0) {
      velocity.x() = i % 2 == 0 ? stage_speed : -stage_speed;
      drops.stage_velocity.col(i) = velocity;
    }
    const double s = std::hypot(s0, s1 * h);
    drops.landed.col(i) =
        drops.target.col(i) + path.offset(h, velocity) + s * Eigen::Vector2d{normal(random), normal(random)};
    drops.diameter(i) = 0.62e-3 + 8e-6 * normal(random);
    if (satellite > 0 && i % satellite == 2) {
      drops.landed.col(i) += 4e-4 * Eigen::Vector2d{normal(random), normal(random)}.normalized();
      drops.diameter(i) = 0.15e-3;
    }
  }
  return drops;
}

TEST(DropletTrajectory, HasTheGoldenOffsets) {
  const DropletTrajectory path = thesis_trajectory();
  EXPECT_NEAR(path.slope.x(), 5.30508e-3, 1e-8);
  EXPECT_NEAR(path.slope.y(), 9.01832e-5, 1e-9);
  EXPECT_TRUE(path.offset(2e-3).isApprox(Eigen::Vector2d{12.610e-6, 118.380e-6}, 1e-4));
  EXPECT_TRUE(path.offset(20e-3).isApprox(Eigen::Vector2d{108.102e-6, 120.004e-6}, 1e-5));
  EXPECT_NEAR(path.tilt() / degree, 0.304, 1e-9);
  EXPECT_NEAR(path.azimuth() / degree, 0.9739, 1e-9);
  // Carry by the stage: 72 mm/s, 2 m/s, 2 mm and 20 mm.
  DropletTrajectory moving = path;
  moving.slowness = 0.5;
  EXPECT_NEAR((moving.offset(2e-3, {0.072, 0.0}) - path.offset(2e-3)).x(), 72e-6, 1e-12);
  EXPECT_NEAR((moving.offset(20e-3, {0.072, 0.0}) - path.offset(20e-3)).x(), 720e-6, 1e-12);
}

TEST(TrajectoryIdentification, FindsTheParametersWithTheSigmasItStates) {
  // Section 11: 20 um of scatter, 20 droplets at 2 and at 20 mm: tilt 0.020 deg, xe 5.0 um (1 sigma).
  const DropletTrajectory truth = thesis_trajectory();
  double tilt_squares = 0.0;
  double placement_squares = 0.0;
  constexpr int trials = 60;
  for (unsigned seed = 1; seed <= trials; ++seed) {
    const TrajectoryFit fit = identify_trajectory(print(truth, {2e-3, 20e-3}, 20, 20e-6, 0.0, 0, seed));
    EXPECT_THAT(fit.unidentified, ::testing::IsEmpty());
    tilt_squares += std::pow((fit.trajectory.slope - truth.slope).x(), 2) / trials;
    placement_squares += std::pow((fit.trajectory.placement - truth.placement).x(), 2) / trials;
    EXPECT_NEAR(fit.tilt_sigma / degree, 0.020, 0.008);
  }
  EXPECT_NEAR(std::sqrt(tilt_squares) / degree, 0.020, 0.006);
  EXPECT_NEAR(std::sqrt(placement_squares), 5.0e-6, 1.5e-6);
}

TEST(TrajectoryIdentification, RejectsSatellitesWithAndWithoutTheirDiameter) {
  const DropletTrajectory truth = thesis_trajectory();
  for (const bool with_diameter : {true, false})
    for (unsigned seed = 1; seed <= 20; ++seed) {
      Droplets drops = print(truth, {2e-3, 20e-3}, 20, 10e-6, 0.5e-3, 5, seed);
      if (!with_diameter) drops.diameter.resize(0);
      const TrajectoryFit fit = identify_trajectory(drops);
      for (Eigen::Index i = 2; i < 40; i += 5) EXPECT_EQ(fit.kept(i), 0.0) << seed;
      EXPECT_GE(fit.kept.sum(), 28.0) << seed;
      for (const double h : {2e-3, 10e-3, 20e-3})
        EXPECT_LT((fit.trajectory.offset(h) - truth.offset(h)).norm(),
                  4.5 * std::max(fit.trajectory.sigma(h), 1e-6))
            << seed;
    }
}

TEST(TrajectoryIdentification, WeighsDropletsByTheScatterOfTheirHeight) {
  const DropletTrajectory truth = thesis_trajectory();
  double weighted = 0.0;
  double plain = 0.0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    const Droplets drops = print(truth, {1e-3, 10e-3, 30e-3}, 20, 2e-6, 2e-3, 0, seed);
    weighted += (identify_trajectory(drops).trajectory.placement - truth.placement).squaredNorm();
    Eigen::MatrixXd a(60, 2);
    a << Eigen::VectorXd::Ones(60), drops.height;
    const Eigen::VectorXd y = (drops.landed - drops.target).row(0).transpose();
    const Eigen::VectorXd z = (drops.landed - drops.target).row(1).transpose();
    const Eigen::Matrix2d inverse = (a.transpose() * a).inverse();
    const Eigen::Vector2d at{(inverse * a.transpose() * y)(0), (inverse * a.transpose() * z)(0)};
    plain += (at - truth.placement).squaredNorm();
  }
  EXPECT_LT(weighted, 0.5 * plain);
}

TEST(TrajectoryIdentification, SaysThatOneHeightCannotTellPlacementFromTilt) {
  const DropletTrajectory truth = thesis_trajectory();
  const TrajectoryFit fit = identify_trajectory(print(truth, {5e-3}, 20, 10e-6, 0.0, 6, 3));
  ASSERT_EQ(fit.unidentified.size(), 1U);
  EXPECT_THAT(fit.unidentified.front(), ::testing::HasSubstr("placement"));
  EXPECT_THAT(fit.unidentified.front(), ::testing::HasSubstr("tilt"));
  EXPECT_LT((fit.trajectory.offset(5e-3) - truth.offset(5e-3)).norm(), 10e-6);
  EXPECT_GT(fit.trajectory.sigma(20e-3), 10.0 * fit.trajectory.sigma(5e-3));
}

TEST(TrajectoryIdentification, FindsTheEjectionSpeedFromBothDirections) {
  DropletTrajectory truth = thesis_trajectory();
  truth.slowness = 0.5;  // 2 m/s
  const TrajectoryFit fit = identify_trajectory(print(truth, {2e-3, 20e-3}, 20, 10e-6, 0.0, 0, 4, 0.072));
  EXPECT_NEAR(1.0 / fit.trajectory.slowness, 2.0, 0.05);
}

TEST(TrajectoryIdentification, TellsTheDelayFromTheCarryAndBothFromSatellites) {
  DropletTrajectory truth = thesis_trajectory();
  truth.slowness = 0.5;
  truth.delay = 4e-4;
  double squares = 0.0;
  double stated = 0.0;
  constexpr int trials = 40;
  for (unsigned seed = 1; seed <= trials; ++seed) {
    const TrajectoryFit fit =
        identify_trajectory(print(truth, {2e-3, 20e-3}, 20, 8e-6, 1e-3, 7, 10 + seed, 0.05));
    squares += std::pow(fit.trajectory.delay - truth.delay, 2) / trials;
    stated += std::pow(fit.trajectory.delay_sigma, 2) / trials;
    EXPECT_NEAR(fit.trajectory.slowness, truth.slowness, 5.0 * fit.trajectory.slowness_sigma) << seed;
    EXPECT_GE(fit.kept.sum(), 31.0) << seed;
    for (Eigen::Index i = 2; i < 40; i += 7) EXPECT_EQ(fit.kept(i), 0.0) << seed;
  }
  EXPECT_NEAR(std::sqrt(squares / stated), 1.0, 0.35);
}

TEST(TrajectoryIdentification, SaysThatOneVelocityLeavesTheCarryOpen) {
  DropletTrajectory truth = thesis_trajectory();
  truth.slowness = 0.5;
  Droplets drops = print(truth, {2e-3, 20e-3}, 20, 10e-6, 0.0, 0, 4, 0.072);
  for (Eigen::Index i = 0; i < drops.height.size(); ++i) {
    drops.stage_velocity.col(i) << 0.072, 0.0;
    drops.landed.col(i) = drops.target.col(i) + truth.offset(drops.height(i), drops.stage_velocity.col(i));
  }
  const TrajectoryFit fit = identify_trajectory(drops);
  ASSERT_EQ(fit.unidentified.size(), 1U);
  EXPECT_THAT(fit.unidentified.front(), ::testing::HasSubstr("carry"));
}

/// A head whose droplets slow down by `rate` of their speed a second; RMS error over the last half of the print of the model
/// that was identified at its start, and of the tracked one.
void print_with_drift(double rate, double& fixed, double& tracked, double& change) {
  DropletTrajectory truth = thesis_trajectory();
  truth.slowness = 0.5;
  truth.delay = 3e-4;
  constexpr double scatter = 15e-6;
  const TrajectoryFit fit = identify_trajectory(print(truth, {2e-3, 20e-3}, 40, scatter, 0.0, 0, 21, 0.05));
  TrajectoryTracker tracker{fit, {}};
  std::mt19937 random{22};
  std::normal_distribution<double> normal;
  fixed = tracked = 0.0;
  constexpr int count = 1200;
  for (int i = 0; i < count; ++i) {
    const double time = 0.1 * i;
    const Eigen::Vector2d velocity{(i / 5) % 2 == 0 ? 0.05 : -0.05, 0.0};
    DropletTrajectory drifted = truth;
    drifted.slowness *= std::exp(rate * time);
    const Eigen::Vector2d systematic = drifted.offset(20e-3, velocity);
    if (i >= count / 2) {
      fixed += (systematic - fit.trajectory.offset(20e-3, velocity)).squaredNorm() / (count / 2);
      tracked += (systematic - tracker.trajectory().offset(20e-3, velocity)).squaredNorm() / (count / 2);
    }
    const Eigen::Vector2d noise{scatter * normal(random), scatter * normal(random)};
    const Eigen::Vector2d satellite{i % 20 == 7 ? 3e-4 : 0.0, 0.0};
    EXPECT_EQ(tracker.add(time, 20e-3, velocity, systematic + noise + satellite), i % 20 != 7) << i;
  }
  fixed = std::sqrt(fixed);
  tracked = std::sqrt(tracked);
  change = tracker.change(20e-3, {0.05, 0.0});
}

TEST(TrajectoryTracker, FollowsASlowLossOfSpeedAndLeavesSatellitesOut) {
  double fixed = 0.0, tracked = 0.0, change = 0.0;
  print_with_drift(1e-3, fixed, tracked, change);
  // 500 um of carry, 12 % slower after two minutes: 60 um.
  EXPECT_GT(fixed, 40e-6);
  EXPECT_LT(tracked, 8e-6);
  EXPECT_NEAR(change, 500e-6 * (std::exp(0.12) - 1.0), 15e-6);
}

TEST(TrajectoryTracker, LeavesAHeadThatDoesNotDriftNearlyAsItWas) {
  double fixed = 0.0, tracked = 0.0, change = 0.0;
  print_with_drift(0.0, fixed, tracked, change);
  EXPECT_LT(tracked, 6e-6);
  EXPECT_LT(change, 15e-6);
}

TEST(TrajectoryIdentification, AcceptsOneDropletAtEachOfSeveralHeights) {
  const DropletTrajectory truth = thesis_trajectory();
  const TrajectoryFit fit = identify_trajectory(print(truth, {2e-3, 8e-3, 14e-3, 20e-3}, 1, 5e-6, 0.0, 0, 5));
  EXPECT_EQ(fit.kept.sum(), 4.0);
  EXPECT_LT((fit.trajectory.offset(10e-3) - truth.offset(10e-3)).norm(), 15e-6);
}

/// Droplets over a plate of 200 by 120 mm whose frame is turned and scaled against the stage's, and curved by `bow` at
/// the ends.
Droplets over_plate(const Eigen::Matrix2d& field, double bow, double scatter, unsigned seed,
                    int satellite = 0) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  constexpr Eigen::Index n = 77;
  Droplets drops{Eigen::Matrix2Xd(2, n), Eigen::Matrix2Xd(2, n), Eigen::VectorXd::Constant(n, 3e-3), {}, {}};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector2d at{0.02 * static_cast<double>(i % 11), 0.02 * static_cast<double>(i / 11)};
    drops.target.col(i) = at;
    drops.landed.col(i) = at + Eigen::Vector2d{4e-5, -7e-5} + field * at +
                          Eigen::Vector2d{0.0, bow * std::pow(at.x() / 0.1 - 1.0, 2)} +
                          scatter * Eigen::Vector2d{normal(random), normal(random)};
    if (satellite > 0 && i % satellite == 1) drops.landed.col(i) += Eigen::Vector2d{3e-4, -2e-4};
  }
  return drops;
}

TEST(TrajectoryIdentification, FindsRotationAndScaleOfTheFieldWithTheSigmasItStates) {
  Eigen::Matrix2d turned, any;
  turned << 1e-4, -6e-4, 6e-4, 1e-4;
  any << 3e-4, -6e-4, 9e-4, -2e-4;
  for (const auto& [field, form] :
       {std::pair{turned, FieldForm::rotation_and_scale}, std::pair{any, FieldForm::any}}) {
    int within = 0;
    for (unsigned seed = 1; seed <= 40; ++seed) {
      const TrajectoryFit fit = identify_trajectory(over_plate(field, 0.0, 8e-6, seed, 9));
      ASSERT_EQ(fit.field_form, form) << seed;
      const auto& path = fit.trajectory;
      const Eigen::Vector2d target{0.2, 0.12};
      const Eigen::Vector2d aimed = path.aim(target, 3e-3);
      const Eigen::Vector2d lands = aimed + Eigen::Vector2d{4e-5, -7e-5} + field * aimed;
      within += (lands - target).cwiseAbs().maxCoeff() <= 2.0 * path.sigma(3e-3, aimed) ? 1 : 0;
      EXPECT_LT((lands - target).norm(), 1e-5) << seed;
      EXPECT_NEAR(fit.after_rms, 8e-6 * std::sqrt(2.0), 2.5e-6) << seed;
      for (Eigen::Index i = 1; i < 77; i += 9) EXPECT_EQ(fit.kept(i), 0.0) << seed;
      EXPECT_GE(fit.kept.sum(), 77.0 - 9.0 - 3.0) << seed;
    }
    EXPECT_GT(within, 30);  // both components within two sigma: 0.91 of 40
  }
}

TEST(TrajectoryIdentification, CallsWhatIsLeftScatterOnlyWhereATestDoes) {
  int called_pattern = 0;
  for (unsigned seed = 1; seed <= 50; ++seed) {
    const TrajectoryFit fit = identify_trajectory(over_plate(Eigen::Matrix2d::Zero(), 0.0, 8e-6, seed));
    EXPECT_EQ(fit.field_form, FieldForm::none) << seed;
    EXPECT_TRUE(fit.scatter.tested);
    called_pattern += fit.scatter.probability < significant ? 1 : 0;
  }
  EXPECT_LE(called_pattern, 3);
  const TrajectoryFit curved = identify_trajectory(over_plate(Eigen::Matrix2d::Zero(), 3e-5, 8e-6, 1));
  EXPECT_LT(curved.scatter.probability, 1e-6);
  EXPECT_THAT(curved.scatter.pattern, ::testing::HasSubstr("curved"));
  Droplets drifting = over_plate(Eigen::Matrix2d::Zero(), 0.0, 2e-6, 1);
  for (Eigen::Index i = 0; i < 77; ++i)
    drifting.landed(0, i) += 1e-5 * std::sin(0.5 * static_cast<double>(i));
  const TrajectoryFit drift = identify_trajectory(drifting);
  EXPECT_LT(drift.scatter.probability, significant);
  EXPECT_THAT(drift.scatter.pattern, ::testing::HasSubstr("from one droplet to the next"));
  EXPECT_FALSE(identify_trajectory(print(thesis_trajectory(), {2e-3}, 4, 1e-5, 0.0, 0, 1)).scatter.tested);
}

TEST(TrajectoryIdentification, KeepsDropletsThatAreLargerThanTheirFellows) {
  Droplets drops = over_plate(Eigen::Matrix2d::Zero(), 0.0, 8e-6, 4);
  drops.diameter = Eigen::VectorXd::Constant(77, 5e-4);
  drops.diameter.head(20).setConstant(8e-4);
  drops.diameter(70) = 1e-4;
  const TrajectoryFit fit = identify_trajectory(drops);
  EXPECT_GE(fit.kept.head(20).sum(), 18.0);
  EXPECT_EQ(fit.kept(70), 0.0);
}

TEST(DropletStatistics, AreThoseOfTheThesisSecondCase) {
  // 400 readings of a normal distribution: 68.3 and 95.4 %, compatible with normal.
  std::mt19937 random{6};
  std::normal_distribution<double> normal{0.664e-3, 0.008e-3};
  Eigen::VectorXd d(400);
  for (double& value : d) value = normal(random);
  const DropletStatistics statistics = droplet_statistics(d);
  EXPECT_NEAR(statistics.mean, 0.664e-3, 2e-6);
  EXPECT_NEAR(statistics.deviation, 0.008e-3, 1e-6);
  EXPECT_NEAR(statistics.mean_error, 0.4e-6, 0.05e-6);
  EXPECT_NEAR(statistics.within_one, 0.683, 0.06);
  EXPECT_NEAR(statistics.within_two, 0.954, 0.03);
  EXPECT_GT(statistics.probability, 0.05);
}

}  // namespace
}  // namespace invar::metrology
