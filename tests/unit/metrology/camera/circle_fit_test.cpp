#include "core/metrology/camera/circle_fit.hpp"

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <random>

namespace invar::metrology {
namespace {

using Eigen::Index;
using Eigen::Matrix2Xd;
using Eigen::Vector2d;

using Fit = std::function<std::optional<Circle>(Outline)>;

std::optional<Circle> geometric(Outline points) {
  const auto start = taubin_circle(points);
  if (!start) return std::nullopt;
  const auto fit = geometric_circle(points, *start);
  if (!fit) return std::nullopt;
  return fit->circle;
}

Matrix2Xd golden_points() {
  Matrix2Xd points(2, 5);
  points << 3, 1, -1, 1, 1 + std::numbers::sqrt2, 1, 3, 1, -1, 1 + std::numbers::sqrt2;
  return points;
}

// An arc of a circle of 24 px about (3, -5), radial noise of 0.5 px, one point a pixel of outline.
Matrix2Xd noisy_arc(double degrees, double noise, std::mt19937_64& random) {
  const Index n = std::lround(150.0 * degrees / 360.0);
  std::normal_distribution<double> normal{0.0, noise};
  const auto steps = static_cast<double>(degrees < 360.0 ? n - 1 : n);  // an arc includes both its ends
  Matrix2Xd points(2, n);
  for (Index i = 0; i < n; ++i) {
    const double angle = degrees * std::numbers::pi / 180.0 * static_cast<double>(i) / steps;
    points.col(i) =
        Vector2d{3.0, -5.0} + (24.0 + normal(random)) * Vector2d{std::cos(angle), std::sin(angle)};
  }
  return points;
}

TEST(CircleFit, EveryFitIsExactOnTheGoldenCircle) {
  for (const Fit& fit : {Fit{kasa_circle}, Fit{pratt_circle}, Fit{taubin_circle}, Fit{geometric}}) {
    const auto circle = fit(golden_points());
    ASSERT_TRUE(circle);
    EXPECT_NEAR(circle->center.x(), 1.0, 1e-12);
    EXPECT_NEAR(circle->center.y(), 1.0, 1e-12);
    EXPECT_NEAR(circle->radius, 2.0, 1e-12);
  }
  const auto robust = robust_circle(golden_points());
  ASSERT_TRUE(robust);
  EXPECT_NEAR(robust->circle.radius, 2.0, 1e-9);
}

TEST(CircleFit, NothingIsReturnedWherePointsHaveNoCircle) {
  Matrix2Xd line(2, 4);
  line << 0, 1, 2, 3, 5, 7, 9, 11;
  const Matrix2Xd same = Matrix2Xd::Constant(2, 6, 4.0);
  Matrix2Xd broken = golden_points();
  broken(0, 2) = std::nan("");
  for (const Matrix2Xd& points : {line, same, broken, Matrix2Xd{golden_points().leftCols<2>()}}) {
    EXPECT_FALSE(kasa_circle(points));
    EXPECT_FALSE(pratt_circle(points));
    EXPECT_FALSE(taubin_circle(points));
    EXPECT_FALSE(robust_circle(points));
  }
}

TEST(CircleFit, ShiftingAndScalingThePointsShiftsAndScalesTheCircle) {
  std::mt19937_64 random{7};
  const Matrix2Xd points = noisy_arc(200.0, 0.5, random);
  const Matrix2Xd moved = (1e-5 * points).colwise() + Vector2d{0.3, -0.2};
  for (const Fit& fit : {Fit{kasa_circle}, Fit{pratt_circle}, Fit{taubin_circle}, Fit{geometric}}) {
    const auto before = fit(points), after = fit(moved);
    ASSERT_TRUE(before && after);
    EXPECT_NEAR(after->radius, 1e-5 * before->radius, 1e-13);
    EXPECT_NEAR((after->center - Vector2d{0.3, -0.2} - 1e-5 * before->center).norm(), 0.0, 1e-13);
  }
}

// Bias and RMS of the radius on arcs, beside a table that was computed independently of this code.
TEST(CircleFit, RadiusBiasAndRmsOnArcsAreThoseOfTheTable) {
  struct Row {
    double degrees;
    double bias[4], rms[4];  // Kasa, Pratt, Taubin, geometric
  };
  const Row rows[] = {{360, {0.005, 0.016, 0.005, 0.000}, {0.043, 0.045, 0.043, 0.042}},
                      {180, {-0.035, 0.015, 0.005, 0.001}, {0.135, 0.132, 0.131, 0.131}},
                      {90, {-0.84, 0.04, 0.03, 0.03}, {1.12, 0.81, 0.81, 0.81}},
                      {60, {-3.6, 0.10, 0.09, 0.11}, {4.0, 2.2, 2.2, 2.2}}};
  const Fit fits[] = {kasa_circle, pratt_circle, taubin_circle, geometric};
  constexpr unsigned seed = 20260101;
  constexpr int trials = 4000;
  std::printf("seed %u\n", seed);
  for (const Row& row : rows) {
    std::mt19937_64 random{seed};
    double sum[4] = {}, square[4] = {};
    for (int trial = 0; trial < trials; ++trial) {
      const Matrix2Xd points = noisy_arc(row.degrees, 0.5, random);
      for (int k = 0; k < 4; ++k) {
        const auto circle = fits[k](points);
        ASSERT_TRUE(circle) << "arc " << row.degrees << ", trial " << trial << ", fit " << k;
        sum[k] += circle->radius - 24.0;
        square[k] += std::pow(circle->radius - 24.0, 2);
      }
    }
    for (int k = 0; k < 4; ++k) {
      const double rms = std::sqrt(square[k] / trials);
      // Four standard errors of the mean for the bias (in the table, too); 10 % for the RMS, whose tails are
      // long on short arcs.
      EXPECT_NEAR(sum[k] / trials, row.bias[k], 4.0 * 1.5 * row.rms[k] / std::sqrt(trials) + 0.004)
          << "arc " << row.degrees << ", fit " << k;
      EXPECT_NEAR(rms, row.rms[k], 0.10 * row.rms[k] + 0.002) << "arc " << row.degrees << ", fit " << k;
    }
  }
}

TEST(CircleFit, CovarianceSaysHowFarTheFitIsOff) {
  constexpr unsigned seed = 5;
  constexpr int trials = 2000;
  std::printf("seed %u\n", seed);
  std::mt19937_64 random{seed};
  double chi_square = 0.0;
  for (int trial = 0; trial < trials; ++trial) {
    const Matrix2Xd points = noisy_arc(240.0, 0.5, random);
    const auto fit = geometric_circle(points, {{3.0, -5.0}, 24.0});
    ASSERT_TRUE(fit);
    const Eigen::Vector3d error{fit->circle.center.x() - 3.0, fit->circle.center.y() + 5.0,
                                fit->circle.radius - 24.0};
    chi_square += error.dot(fit->covariance.inverse() * error) / trials;
  }
  EXPECT_NEAR(chi_square, 3.0 * 97.0 / 95.0, 0.25);  // Hotelling's T^2 with 100 - 3 degrees of freedom
}

TEST(CircleFit, ASatelliteOnATenthOfTheOutlineHardlyMovesTheRobustFit) {
  constexpr unsigned seed = 11;
  constexpr int trials = 200;
  std::printf("seed %u\n", seed);
  std::mt19937_64 random{seed};
  double kasa = 0.0, robust = 0.0;
  for (int trial = 0; trial < trials; ++trial) {
    Matrix2Xd points = noisy_arc(360.0, 0.5, random);
    for (Index i = 20; i < 35; ++i) points.col(i) += 6.0 * (points.col(i) - Vector2d{3.0, -5.0}).normalized();
    kasa += (kasa_circle(points)->center - Vector2d{3.0, -5.0}).norm() / trials;
    robust += (robust_circle(points)->circle.center - Vector2d{3.0, -5.0}).norm() / trials;
  }
  EXPECT_NEAR(kasa, 1.48, 0.15);
  EXPECT_LT(robust, 0.10);
}

}  // namespace
}  // namespace invar::metrology
