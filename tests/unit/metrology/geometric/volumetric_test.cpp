#include "core/metrology/geometric/volumetric.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace invar::metrology {
namespace {

constexpr double um = 1e-6;
constexpr double urad = 1e-6;

/// The machine of docs/explanation/geometric.md#golden-numbers.
ErrorMotions golden_motions() {
  ErrorMotions m;
  m[0].translation = Eigen::Vector3d{1, -2, .5} * um;
  m[1].translation = Eigen::Vector3d{1.5, -.7, .3} * um;
  m[2].translation = Eigen::Vector3d{-1.2, .8, 2} * um;
  m[0].rotation = Eigen::Vector3d{5, -3, 4} * urad;
  m[1].rotation = Eigen::Vector3d{2, 6, -5} * urad;
  m[2].rotation = Eigen::Vector3d{1, -2, 3} * urad;
  return m;
}
const Squareness golden_squareness{20 * urad, -10 * urad, 15 * urad};
const Eigen::Vector3d golden_position{0.1, 0.15, 0.05};
const Eigen::Vector3d golden_tool{0.01, 0.02, -0.03};

TEST(Volumetric, GivesTheGoldenFieldOfTheChainYXZ) {
  const Chain chain{{1, 0, 2}, 3};
  const auto e = linear_error(chain, axis_directions(chain, golden_squareness), golden_position,
                              golden_motions(), golden_tool);
  EXPECT_NEAR(e.x(), 0.88 * um, 1e-11);
  EXPECT_NEAR(e.y(), 0.26 * um, 1e-11);
  EXPECT_NEAR(e.z(), 2.35 * um, 1e-11);
}

TEST(Volumetric, AgreesWithTheTransformProductForAllSixChains) {
  std::array<int, 3> order{0, 1, 2};
  do {
    const Chain chain{order, 3};
    const auto directions = axis_directions(chain, golden_squareness);
    const auto motions = golden_motions();
    const Eigen::Vector3d linear = linear_error(chain, directions, golden_position, motions, golden_tool);
    // An independent route: homogeneous transforms of Eigen, one after the other.
    Eigen::Isometry3d product = Eigen::Isometry3d::Identity();
    for (const int axis : order) {
      const auto& m = motions[static_cast<std::size_t>(axis)];
      product.translate(golden_position[axis] * directions.col(axis) + m.translation);
      product.rotate(Eigen::AngleAxisd{m.rotation.norm(), m.rotation.normalized()});
    }
    const Eigen::Vector3d reference = product * golden_tool - golden_position - golden_tool;
    const auto exact = exact_error(chain, directions, golden_position, motions, golden_tool);
    EXPECT_LT((exact - reference).norm(), 1e-15);
    EXPECT_LT((exact - linear).norm(), 1e-9);
  } while (std::next_permutation(order.begin(), order.end()));
}

TEST(Volumetric, TellsWhichAnglesHaveNoArmAtZeroToolOffset) {
  // An angle counts unless every axis after its own is parallel to it; only four are absent for every order.
  std::array<int, 3> order{0, 1, 2};
  const auto directions = Eigen::Matrix3d::Identity();
  do {
    const Chain chain{order, 3};
    const Eigen::Matrix3d arms = lever_arms(chain, directions, {0.1, 0.2, 0.3}, Eigen::Vector3d::Zero());
    int absent = 0;
    for (int c = 0; c < error_motion_count; ++c)
      if (is_rotation(c) && Eigen::Vector3d::Unit(direction_of(c)).cross(arms.col(axis_of(c))).norm() < 1e-15)
        ++absent;
    EXPECT_EQ(absent, 4);
  } while (std::next_permutation(order.begin(), order.end()));
}

TEST(Volumetric, KeepsTheExactDirectionOfALargeSquareness) {
  // 900 arcsec over 200 mm: the linear form would miss x (1 - sin a_xy) = 1.9 um.
  const Chain chain{{1, 0, 2}, 2};
  const double cosine = std::cos(89.75000944 * std::numbers::pi / 180.0);
  EXPECT_NEAR(cosine, 0.00436314, 1e-8);
  const auto e = linear_error(chain, axis_directions(chain, {cosine, 0.0, 0.0}), {0.2, 0.2, 0.0}, {},
                              Eigen::Vector3d::Zero());
  EXPECT_NEAR(e.x(), -1.9037 * um, 1e-10);
  EXPECT_NEAR((Eigen::Vector3d{0.2, 0.2, 0.0} + e).norm(), 0.283459083, 1e-9);
}

TEST(Volumetric, ShowsTheNullVectorOfTheFourLines) {
  // EXY = 2 um sin(2 pi y/L), EYX = -2 um sin(2 pi x/L): no line of the thesis's four sees it.
  const Chain chain{{1, 0, 2}, 2};
  const double travel = 0.2;
  const auto field = [&](double x, double y) {
    ErrorMotions m;
    m[1].translation.x() = 2 * um * std::sin(2 * std::numbers::pi * y / travel);
    m[0].translation.y() = -2 * um * std::sin(2 * std::numbers::pi * x / travel);
    return linear_error(chain, Eigen::Matrix3d::Identity(), {x, y, 0.0}, m, Eigen::Vector3d::Zero());
  };
  double seen = 0.0;
  double half_slope = 0.0;
  for (double t = 0.0; t <= travel; t += 0.005) {
    seen = std::max({seen, std::abs(field(t, 0).x()), std::abs(field(0, t).y()),
                     std::abs(field(travel, t).y()), std::abs(field(t, t).x() + field(t, t).y())});
    half_slope =
        std::max(half_slope, std::abs(2 * field(t, t / 2).x() + field(t, t / 2).y()) / std::sqrt(5.0));
  }
  EXPECT_LT(seen, 1e-15);
  EXPECT_NEAR(half_slope, 2.32 * um, 0.01 * um);
  double sum = 0.0;
  for (int i = 0; i < 21; ++i)
    for (int j = 0; j < 21; ++j) sum += field(0.01 * i, 0.01 * j).squaredNorm();
  EXPECT_NEAR(std::sqrt(sum / 441), 1.9518 * um, 1e-10);
  // After the best planar rigid motion.
  Eigen::MatrixXd modes(2 * 441, 3);
  Eigen::VectorXd all(2 * 441);
  for (int i = 0; i < 441; ++i) {
    const double x = 0.01 * (i % 21);
    const double y = 0.01 * (i / 21);
    modes.middleRows<2>(2 * i) << 1, 0, -y, 0, 1, x;
    all.segment<2>(2 * i) = field(x, y).head<2>();
  }
  all -= modes * modes.householderQr().solve(all).eval();
  EXPECT_NEAR(std::sqrt(all.squaredNorm() / 441), 1.3555 * um, 1e-10);
}

TEST(Components, NamesFollowIsoAndTheThesis) {
  EXPECT_EQ(iso_name(translation(1, 0)), "EYX");
  EXPECT_EQ(iso_name(rotation(2, 1)), "ECY");
  EXPECT_EQ(thesis_symbol(rotation(2, 0)), "eps_z(x)");
  for (int c = 0; c < error_motion_count; ++c) EXPECT_EQ(error_motion_named(iso_name(c)), c);
  EXPECT_FALSE(error_motion_named("EC0Y"));
}

TEST(Components, SquarenessTurnsAsIsoSays) {
  // Positive EC0Y turns +Y about +Z: the y axis then leans towards -x, so the cosine is negative.
  for (int pair = 0; pair < squareness_count; ++pair)
    EXPECT_NEAR(squareness_angle_from_cosine(pair, squareness_cosine_from_angle(pair, 3e-4)), 3e-4, 1e-18);
  EXPECT_LT(squareness_cosine_from_angle(0, 1e-4), 0.0);
  EXPECT_GT(squareness_cosine_from_angle(1, 1e-4), 0.0);
  EXPECT_LT(squareness_cosine_from_angle(2, 1e-4), 0.0);
}

}  // namespace
}  // namespace invar::metrology
