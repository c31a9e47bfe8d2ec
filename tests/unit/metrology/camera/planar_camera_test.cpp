#include "core/metrology/camera/planar_camera.hpp"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "core/metrology/camera/bad_views.hpp"

namespace invar::metrology {
namespace {

using Eigen::Index;
using Eigen::Matrix2Xd;
using Eigen::Vector3d;

// A grid of 8 x 8 points, 20 mm apart.
Matrix2Xd grid() {
  Matrix2Xd out(2, 64);
  for (Index i = 0; i < 64; ++i)
    out.col(i) << 0.02 * static_cast<double>(i % 8), 0.02 * static_cast<double>(i / 8);
  return out;
}

PinholeCamera camera() { return {832.5, 832.53, 303.96, 206.59, 0.2, {-0.2286, 0.1904, 0.0}, {}}; }

std::vector<Matrix2Xd> views(const PinholeCamera& camera, double noise, unsigned seed) {
  const Vector3d turns[] = {
      {0.5, 0.1, 0.0}, {-0.4, 0.3, 0.1}, {0.1, -0.6, 0.05}, {0.3, 0.4, 1.0}, {0.02, 0.1, -0.3}};
  std::mt19937_64 random{seed};
  std::normal_distribution<double> normal{0.0, noise};
  std::vector<Matrix2Xd> out;
  for (const Vector3d& turn : turns) {
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd{turn.norm(), turn.normalized()}.toRotationMatrix();
    Matrix2Xd view(2, 64);
    for (Index i = 0; i < 64; ++i) {
      Vector3d point;
      point << grid().col(i), 0.0;
      view.col(i) = camera.project(rotation * (point - Vector3d{0.07, 0.07, 0.0}) + Vector3d{0.0, 0.0, 0.35});
      view(0, i) += normal(random);
      view(1, i) += normal(random);
    }
    out.push_back(view);
  }
  return out;
}

TEST(PlanarCamera, ExactViewsGiveTheCameraBack) {
  const auto fit = calibrate_planar(grid(), views(camera(), 0.0, 1), Lens::radial_2);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->camera.fx, camera().fx, 1e-5);
  EXPECT_NEAR(fit->camera.fy, camera().fy, 1e-5);
  EXPECT_NEAR(fit->camera.u0, camera().u0, 1e-5);
  EXPECT_NEAR(fit->camera.v0, camera().v0, 1e-5);
  EXPECT_NEAR(fit->camera.skew, camera().skew, 1e-5);
  EXPECT_NEAR(fit->camera.radial[0], camera().radial[0], 1e-7);
  EXPECT_NEAR(fit->camera.radial[1], camera().radial[1], 1e-6);
  EXPECT_LT(fit->rms, 1e-6);
}

TEST(PlanarCamera, NoisyViewsGiveItBackWithinTheStatedSigmas) {
  double chi = 0.0;
  constexpr int trials = 12;
  std::printf("seeds 100..%d\n", 99 + trials);
  for (unsigned i = 0; i < trials; ++i) {
    const auto fit = calibrate_planar(grid(), views(camera(), 0.2, 100 + i), Lens::radial_2);
    ASSERT_TRUE(fit);
    chi += std::pow((fit->camera.fx - camera().fx) / fit->sigma.fx, 2) +
           std::pow((fit->camera.u0 - camera().u0) / fit->sigma.u0, 2) +
           std::pow((fit->camera.radial[0] - camera().radial[0]) / fit->sigma.radial[0], 2);
    EXPECT_NEAR(fit->rms, 0.2 * std::sqrt(2.0), 0.03);
  }
  EXPECT_NEAR(chi / (3.0 * trials), 1.0, 0.7);
}

TEST(PlanarCamera, HeldOutViewsTellTheLensFromAPinholeAndFromMoreThanItIs) {
  const auto seen = views(camera(), 0.1, 7);
  const auto score = [&](Lens lens) {
    const auto left_out = leave_one_view_out(grid(), seen, lens);
    if (!left_out) return std::nan("");
    double sum = 0.0;
    for (const double rms : *left_out) sum += rms * rms / 5.0;
    return std::sqrt(sum);
  };
  EXPECT_GT(score(Lens::pinhole), 3.0 * score(Lens::radial_2));
  EXPECT_LT(score(Lens::radial_2), 0.16);  // 0.141 is the noise itself
}

// Zhang's own five views of 256 corners, where they are at hand: environment INVAR_SHARED or ../shared.
Matrix2Xd read_csv(const std::filesystem::path& file) {
  std::ifstream in{file};
  std::string line;
  std::getline(in, line);  // names
  std::vector<double> numbers;
  while (std::getline(in, line)) {
    const auto comma = line.find(',');
    if (comma == std::string::npos) continue;
    numbers.push_back(std::stod(line.substr(0, comma)));
    numbers.push_back(std::stod(line.substr(comma + 1)));
  }
  return Eigen::Map<Matrix2Xd>(numbers.data(), 2, static_cast<Index>(numbers.size() / 2));
}

TEST(PlanarCamera, PublishedCalibrationOfRealViewsIsReproduced) {
  const char* shared = std::getenv("INVAR_SHARED");
  const std::filesystem::path folder =
      (shared != nullptr ? std::filesystem::path{shared}
                         : std::filesystem::path{INVAR_SOURCE_DIR} / "../shared") /
      "data/camera-planar-target";
  if (!std::filesystem::exists(folder / "target.csv")) {
    std::printf("no recordings at %s: nothing was compared\n", folder.c_str());
    return;
  }
  std::vector<Matrix2Xd> seen;
  for (int view = 1; view <= 5; ++view)
    seen.push_back(read_csv(folder / ("view" + std::to_string(view) + ".csv")));
  const Matrix2Xd target = read_csv(folder / "target.csv");
  const auto fit = calibrate_planar(target, seen, Lens::radial_2);
  ASSERT_TRUE(fit);
  // Zhang (2000), table 1, five images.
  EXPECT_NEAR(fit->camera.fx, 832.5, 0.05);
  EXPECT_NEAR(fit->camera.fy, 832.53, 0.05);
  EXPECT_NEAR(fit->camera.u0, 303.96, 0.05);
  EXPECT_NEAR(fit->camera.v0, 206.59, 0.05);
  EXPECT_NEAR(fit->camera.skew, 0.2045, 0.001);
  EXPECT_NEAR(fit->camera.radial[0], -0.2286, 2e-4);
  EXPECT_NEAR(fit->camera.radial[1], 0.1903, 5e-4);
  EXPECT_NEAR(fit->rms, 0.335, 0.002);
  const auto left_out = leave_one_view_out(target, seen, Lens::radial_2);
  ASSERT_TRUE(left_out);
  for (const double rms : *left_out) EXPECT_LT(rms, 0.6);
}

TEST(PlanarCamera, WhatDoesNotDetermineACameraIsRefused) {
  const auto seen = views(camera(), 0.0, 1);
  EXPECT_FALSE(calibrate_planar(grid(), {seen[0], seen[1]}, Lens::pinhole));
  Matrix2Xd line = grid();
  line.row(1).setZero();
  EXPECT_FALSE(calibrate_planar(line, seen, Lens::pinhole));
}

// Nine views, each turned at random about all axes.
std::vector<Matrix2Xd> nine_views(const PinholeCamera& camera, double noise, unsigned seed) {
  std::mt19937_64 random{seed};
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> turn{-0.5, 0.5};
  std::vector<Matrix2Xd> out;
  while (out.size() < 9) {
    const Vector3d axis{turn(random), turn(random), turn(random)};
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd{axis.norm(), axis.normalized()}.toRotationMatrix();
    const Vector3d middle{0.05 * turn(random), 0.05 * turn(random), 0.38 + 0.1 * turn(random)};
    Matrix2Xd view(2, 64);
    for (Index i = 0; i < 64; ++i) {
      const Vector3d point{grid()(0, i) - 0.07, grid()(1, i) - 0.07, 0.0};
      view.col(i) = camera.project(rotation * point + middle);
      view.col(i) += noise * Eigen::Vector2d{normal(random), normal(random)};
    }
    out.push_back(view);
  }
  return out;
}

// A view in which something is wrong is found and named, whatever it is.
TEST(BadViews, AreFoundAndNamed) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const auto sound = nine_views(camera(), 0.2, seed);
    EXPECT_TRUE(sort_views(grid(), sound).bad.empty()) << seed;
    const std::size_t which = seed % sound.size();
    const auto with = [&](const Matrix2Xd& view) {
      auto given = sound;
      given[which] = view;
      return sort_views(grid(), given);
    };
    const auto expect = [&](const SortedViews& sorted, const std::string& why) {
      ASSERT_EQ(sorted.bad.size(), 1u) << seed << ' ' << why;
      EXPECT_EQ(sorted.bad.front().view, which) << seed;
      EXPECT_THAT(sorted.bad.front().why, ::testing::HasSubstr(why)) << seed;
      EXPECT_EQ(sorted.good.size(), sound.size() - 1);
    };
    Matrix2Xd doubled = sound[which];
    doubled.col(12) = doubled.col(11);
    expect(with(doubled), "point 13 lies where point 12 should");
    Matrix2Xd exchanged = sound[which];
    exchanged.col(30).swap(exchanged.col(31));
    expect(with(exchanged), "point 31 lies where point 32 should");
    expect(with(sound[which].colwise().reverse()), "u and v are exchanged");
    Matrix2Xd shifted(2, 64);
    for (Index i = 0; i < 64; ++i) shifted.col(i) = sound[which].col((i + 5) % 64);
    expect(with(shifted), "not in the order");
  }
}

TEST(BadViews, ALensThatBendsOneViewMostIsNoBadView) {
  PinholeCamera bent = camera();
  bent.radial = {-0.35, 0.15, 0.0};
  for (unsigned seed = 1; seed <= 5; ++seed)
    EXPECT_TRUE(sort_views(grid(), nine_views(bent, 0.05, seed)).bad.empty()) << seed;
}

}  // namespace
}  // namespace invar::metrology
