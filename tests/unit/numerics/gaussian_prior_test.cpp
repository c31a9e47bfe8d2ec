#include "core/numerics/gaussian_prior.hpp"

#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <numbers>

namespace invar::numerics {
namespace {

TEST(GaussianPrior, EvidenceEqualsTheDensityOfTheReadings) {
  // Independent route: y ~ N(0, A K A' + noise^2 W^-1), evaluated directly.
  Eigen::MatrixXd a(4, 2);
  a << 1.0, 0.2, 1.0, -0.5, 1.0, 1.1, 1.0, 0.7;
  const Eigen::Vector4d y{0.3, -0.2, 1.4, 0.9};
  const Eigen::Vector4d w{1.0, 0.5, 2.0, 1.0};
  Eigen::MatrixXd l(2, 2);
  l << 0.8, 0.0, 0.3, 1.5;
  const double noise = 0.25;
  const Posterior p = posterior(NormalEquations::of(a, y, w), {l}, noise, Covariance::found);
  const Eigen::MatrixXd k = l * l.transpose();
  Eigen::MatrixXd c = a * k * a.transpose();
  c.diagonal() += noise * noise * w.cwiseInverse();
  EXPECT_NEAR(
      p.log_evidence,
      -0.5 * (y.dot(c.inverse() * y) + std::log(c.determinant()) + 4.0 * std::log(2.0 * std::numbers::pi)),
      1e-10);
  EXPECT_TRUE(p.mean.isApprox(k * a.transpose() * c.inverse() * y, 1e-10));
  EXPECT_TRUE(p.covariance.isApprox(k - k * a.transpose() * c.inverse() * a * k, 1e-10));
}

TEST(GaussianPrior, AReadingOfNoWeightChangesNothing) {
  const Eigen::Vector3d rows{1.0, 2.0, 3.0};
  const Eigen::MatrixXd l = Eigen::MatrixXd::Identity(1, 1);
  const auto with = NormalEquations::of(rows, Eigen::Vector3d{1.0, 2.0, 1e9}, Eigen::Vector3d{1.0, 1.0, 0.0});
  const auto without = NormalEquations::of(rows.head(2), Eigen::Vector2d{1.0, 2.0}, Eigen::Vector2d::Ones());
  EXPECT_DOUBLE_EQ(posterior(with, {l}, 0.1, Covariance::left_out).log_evidence,
                   posterior(without, {l}, 0.1, Covariance::left_out).log_evidence);
}

TEST(Maximise, FindsTheTopOfATiltedValley) {
  const auto f = [](const Eigen::VectorXd& p) {
    return -std::pow(p(0) - 3.0, 2) - std::pow(p(1) + 0.5 * p(0), 2);
  };
  const Eigen::VectorXd top = maximise(f, Eigen::Vector2d::Zero(), 1.0, 1e-3);
  EXPECT_NEAR(top(0), 3.0, 0.1);
  EXPECT_NEAR(top(1), -1.5, 0.1);
}

}  // namespace
}  // namespace invar::numerics
