// Figures of ISO 230-1 against closed forms.
#include "core/metrology/geometric/iso230_motions.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace invar::metrology {
namespace {

Eigen::VectorXd even(Eigen::Index count, double length) {
  return Eigen::VectorXd::LinSpaced(count, 0.0, length);
}

TEST(Straightness, OfAParabolaIsItsSagittaFromEveryLine) {
  // y = 4 h (x/L)(1 - x/L): symmetric, so all three lines are level and all three errors are h.
  const Eigen::VectorXd x = even(201, 0.5);
  const Eigen::VectorXd u = x / 0.5;
  const Eigen::VectorXd y =
      8e-6 * u.array() * (1.0 - u.array()) * 4.0 + 2e-5 * x.array() + 3e-6;  // on a slope
  const Straightness found = straightness(x, y);
  EXPECT_NEAR(found.end_points, 8e-6, 1e-12);
  EXPECT_NEAR(found.least_squares, 8e-6, 1e-12);
  EXPECT_NEAR(found.minimum_zone, 8e-6, 1e-12);
}

TEST(Straightness, OfACubicDiffersByTheLine) {
  // y = u^3 on [0, 1]: ends y = u, extreme at u = 1/sqrt(3): 2/(3 sqrt(3)). Least squares: slope 9/10; extremes of
  // u^3 - 0.9 u at sqrt(0.3) and 1. The minimum zone is found by search over slopes.
  const Eigen::VectorXd x = even(2001, 1.0);
  const Eigen::VectorXd y = x.array().cube();
  const Straightness found = straightness(x, y);
  EXPECT_NEAR(found.end_points, 2.0 / (3.0 * std::sqrt(3.0)), 1e-6);
  const double s = std::sqrt(0.3);
  EXPECT_NEAR(found.least_squares, 0.1 - (s * s * s - 0.9 * s), 1e-4);
  double narrowest = 1.0;
  for (int i = 0; i <= 20000; ++i) {
    const Eigen::VectorXd rest = y - 1e-4 * i * x;
    narrowest = std::min(narrowest, rest.maxCoeff() - rest.minCoeff());
  }
  EXPECT_NEAR(found.minimum_zone, narrowest, 1e-5);
}

TEST(Straightness, MinimumZoneIsNeverWiderThanTheOthers) {
  std::mt19937 random{17};
  RecordProperty("seed", 17);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 200; ++k) {
    const Eigen::VectorXd x = even(2 + k % 30, 1.0);
    const Eigen::VectorXd y = Eigen::VectorXd::NullaryExpr(x.size(), [&] { return normal(random); });
    const Straightness found = straightness(x, y);
    EXPECT_LE(found.minimum_zone, found.end_points + 1e-12) << k;
    EXPECT_LE(found.minimum_zone, found.least_squares + 1e-12) << k;
  }
}

TEST(Straightness, SlopeAgainstTheEndsIsThatOfTheCubic) {
  const Eigen::VectorXd x = even(20001, 1.0);
  EXPECT_NEAR(slope_against_ends(x, x.array().cube()), 0.9 - 1.0, 1e-4);
}

TEST(AngularError, IsTheRange) {
  const Eigen::VectorXd value{{-2e-6, 1e-6, 5e-6, 0.0}};
  EXPECT_NEAR(angular_error(value), 7e-6, 1e-18);
}

TEST(Scatter, OfAMeanIsTheStandardError) {
  const Eigen::VectorXd value = Eigen::VectorXd::Zero(25);
  const Eigen::MatrixXd factor = 2.0 * Eigen::MatrixXd::Identity(25, 25);
  EXPECT_NEAR(scatter_of(value, factor, [](const Eigen::VectorXd& v) { return v.mean(); }), 2.0 / 5.0, 0.05);
}

}  // namespace
}  // namespace invar::metrology
