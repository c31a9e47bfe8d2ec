// Networks against closed forms and against the figures of section 8 of the design (41 samples, 5 mm).
#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <numbers>
#include <random>

#include "core/numerics/lookup_table.hpp"
#include "core/numerics/rbf_descent.hpp"
#include "core/numerics/rbf_kernel.hpp"
#include "core/numerics/rbf_network.hpp"
#include "core/numerics/rbf_ridge.hpp"

namespace invar::numerics {
namespace {

constexpr double micrometre = 1e-6;

/// A random smooth curve of 2 um RMS with 0.4 um at 32 mm pitch, as in section 8. x in m, over 0.2 m.
class Curve {
 public:
  explicit Curve(unsigned seed) {
    std::mt19937 random{seed};
    std::normal_distribution<double> normal;
    double energy = 0.0;
    for (std::size_t k = 0; k < 6; ++k) {
      amplitude_[k] = normal(random) / (1.0 + static_cast<double>(k));
      phase_[k] = std::uniform_real_distribution<double>{0.0, 2.0 * std::numbers::pi}(random);
      energy += 0.5 * amplitude_[k] * amplitude_[k];
    }
    for (double& a : amplitude_) a *= 2.0 * micrometre / std::sqrt(energy);
  }
  double operator()(double x) const {
    double y = 0.4 * micrometre * std::sin(2.0 * std::numbers::pi * x / 0.032);
    for (std::size_t k = 0; k < 6; ++k)
      y += amplitude_[k] * std::sin(std::numbers::pi * (static_cast<double>(k) + 1.0) * x / 0.2 + phase_[k]);
    return y;
  }

 private:
  std::array<double, 6> amplitude_{};
  std::array<double, 6> phase_{};
};

Eigen::MatrixXd samples() { return Eigen::VectorXd::LinSpaced(41, 0.0, 0.2).transpose(); }

Eigen::VectorXd values(const Curve& curve, double noise, unsigned seed) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  Eigen::VectorXd y(41);
  for (Eigen::Index i = 0; i < 41; ++i) y(i) = curve(samples()(0, i)) + noise * normal(random);
  return y;
}

double rms_error(const RbfNetwork& network, const Curve& curve) {
  double squares = 0.0;
  for (int i = 0; i <= 800; ++i) squares += std::pow(network(i * 0.2 / 800) - curve(i * 0.2 / 800), 2);
  return std::sqrt(squares / 801.0);
}

TEST(RbfRidge, ReachesTheFiguresOfSectionEightWithAndWithoutNoise) {
  double clean = 0.0;
  double noisy = 0.0;
  constexpr unsigned curves = 40;
  for (unsigned seed = 1; seed <= curves; ++seed) {
    const Curve curve{seed};
    clean += std::pow(rms_error(fit_ridge(samples(), values(curve, 0.0, seed)).network, curve), 2) / curves;
    noisy +=
        std::pow(rms_error(fit_ridge(samples(), values(curve, 0.46 * micrometre, seed)).network, curve), 2) /
        curves;
  }
  EXPECT_LT(std::sqrt(clean), 0.01 * micrometre);  // the table: 0.003 um
  EXPECT_LT(std::sqrt(noisy), 0.32 * micrometre);  // the table: 0.276 um
}

TEST(RbfRidge, LeaveOneOutInClosedFormEqualsFittingWithoutEachReading) {
  const Curve curve{3};
  const Eigen::VectorXd y = values(curve, 0.46 * micrometre, 5);
  RidgeOptions options;
  options.choice = RidgeChoice::fixed;
  options.ridge = 1e-3;
  options.input_scale = {0.1};
  const RidgeFit all = fit_ridge(samples(), y, options);
  for (const Eigen::Index left_out : {Eigen::Index{7}, Eigen::Index{20}, Eigen::Index{33}}) {
    // The same centres, widths and penalty without the reading: solve the normal equations anew.
    Eigen::MatrixXd a(40, 43);
    Eigen::VectorXd t(40);
    for (Eigen::Index i = 0, row = 0; i < 41; ++i) {
      if (i == left_out) continue;
      const Eigen::VectorXd u = all.network.scaled(samples().col(i));
      a.row(row) << 1.0, u.transpose(), all.network.activations(u).transpose();
      t(row++) = (y(i) - all.network.output_offset) / all.network.output_scale;
    }
    Eigen::MatrixXd h = a.transpose() * a;
    h.diagonal().tail(41).array() += all.ridge;
    const Eigen::VectorXd theta = h.ldlt().solve(a.transpose() * t);
    const Eigen::VectorXd u = all.network.scaled(samples().col(left_out));
    const double predicted = theta(0) + theta(1) * u(0) + theta.tail(41).dot(all.network.activations(u));
    EXPECT_NEAR(all.leave_one_out(left_out),
                y(left_out) - all.network.output_offset - all.network.output_scale * predicted,
                1e-9 * all.network.output_scale);
  }
}

TEST(RbfRidge, SigmaCoversTheErrorInsideAndGrowsOutside) {
  int inside = 0;
  int total = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const Curve curve{seed};
    const RidgeFit fit = fit_ridge(samples(), values(curve, 0.46 * micrometre, seed + 100));
    for (double x = 0.0; x <= 0.2; x += 0.0017) {
      const Eigen::VectorXd at = Eigen::VectorXd::Constant(1, x);
      inside += std::abs(fit.network(x) - curve(x)) <= 2.0 * fit.sigma(at) ? 1 : 0;
      ++total;
    }
    const auto sigma = [&](double x) { return fit.sigma(Eigen::VectorXd::Constant(1, x)); };
    EXPECT_GT(sigma(0.25), 1.5 * sigma(0.2));
    EXPECT_GT(sigma(0.4), sigma(0.25));
    EXPECT_DOUBLE_EQ(fit.network(0.25), fit.network(0.2));  // held
  }
  EXPECT_GT(static_cast<double>(inside) / total, 0.88);
}

TEST(RbfRidge, IsIndependentOfTheUnitsOfInputAndOutput) {
  const Eigen::VectorXd y = values(Curve{2}, 0.46 * micrometre, 2);
  const RidgeFit metres = fit_ridge(samples(), y);
  const RidgeFit other = fit_ridge(samples() * 1e3, y * 1e6);
  for (double x = 0.0; x <= 0.2; x += 0.013)
    EXPECT_NEAR(other.network(x * 1e3), 1e6 * metres.network(x), 1e-6);
}

TEST(RbfRidge, LearnsASurfaceOfTwoInputs) {
  Eigen::MatrixXd x(2, 41 * 7);
  Eigen::VectorXd y(41 * 7);
  const auto surface = [](double p, double t) { return std::sin(20.0 * p) * (1.0 + 0.3 * t) + 0.2 * t * t; };
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    x.col(i) << static_cast<double>(i % 41) * 0.005, 27.0 + 0.5 * static_cast<double>(i / 41);
    y(i) = surface(x(0, i), x(1, i) - 27.0);
  }
  RidgeOptions options;
  options.counts = {14, 5};
  options.spacings = {1.5, 1.5};
  const RidgeFit fit = fit_ridge(x, y, options);
  EXPECT_NEAR(fit.network(Eigen::Vector2d{0.0975, 28.25}), surface(0.0975, 1.25), 5e-3);
  EXPECT_NEAR(fit.network(Eigen::Vector2d{0.0975, 35.0}), fit.network(Eigen::Vector2d{0.0975, 30.0}), 1e-12);
}

TEST(RbfKernel, LeaveOneOutInClosedFormEqualsFittingWithoutEachReading) {
  std::mt19937 random{8};
  std::normal_distribution<double> normal;
  Eigen::MatrixXd x(2, 20);
  Eigen::VectorXd y(20);
  for (Eigen::Index i = 0; i < 20; ++i) {
    x.col(i) << normal(random), normal(random);
    y(i) = std::sin(x(0, i)) + 0.3 * x(1, i) * x(1, i) + 0.05 * normal(random);
  }
  y.array() -= y.mean();  // the mean is taken from all readings
  KernelOptions options;
  options.input_scale = {1.0, 2.0};
  options.lengths = {1.1};
  options.ridges = {0.02};
  const KernelFit all = fit_kernel(x, y, options);
  Eigen::MatrixXd k(19, 19);
  Eigen::VectorXd t(19);
  const auto kernel = [&](Eigen::Index i, Eigen::Index j) {
    const double a = x(0, i) - x(0, j);
    const double b = (x(1, i) - x(1, j)) / 2.0;
    return std::exp(-0.5 * (a * a + b * b) / (1.1 * 1.1));
  };
  for (Eigen::Index i = 0; i < 19; ++i) {
    t(i) = y(i + 1);
    for (Eigen::Index j = 0; j < 19; ++j) k(i, j) = kernel(i + 1, j + 1) + (i == j ? 0.02 : 0.0);
  }
  const Eigen::VectorXd w = k.ldlt().solve(t);
  double predicted = 0.0;
  for (Eigen::Index i = 0; i < 19; ++i) predicted += w(i) * kernel(0, i + 1);
  EXPECT_NEAR(all.leave_one_out(0), y(0) - predicted, 1e-9);
}

TEST(RbfDescent, MovingCentresRunAwayAndFixedOnesApproachTheCurve) {
  const Curve curve{4};
  const Eigen::VectorXd y = values(curve, 0.0, 1);
  DescentOptions seed;  // as printed: sigma 0.05, both rates 0.01, targets in um
  seed.most_epochs = 3000;
  EXPECT_FALSE(train_by_descent(samples(), y, micrometre, seed).converged);
  DescentOptions fixed = seed;
  fixed.rate_centres = 0.0;
  fixed.most_epochs = 20'000;
  const DescentResult result = train_by_descent(samples(), y, micrometre, fixed);
  EXPECT_TRUE(result.converged) << result.mean_square;
  EXPECT_LT(rms_error(result.network, curve), 0.08 * micrometre);
}

TEST(RbfDescent, StopRuleIsTrueBeforeTrainingWhenTargetsAreInMillimetres) {
  // Golden number: 41 targets of 3.9 um RMS are 1.5e-5 mm^2, below 1e-3 before any training.
  Eigen::VectorXd y = values(Curve{5}, 0.0, 1);
  y *= 3.9e-6 / std::sqrt(y.squaredNorm() / 41.0);
  EXPECT_NEAR(y.squaredNorm() / 41.0 * 1e6, 1.5e-5, 0.03e-5);
  const DescentResult result = train_by_descent(samples(), y, 1e-3, {});
  EXPECT_TRUE(result.converged);
  EXPECT_EQ(result.epochs, 1);
}

TEST(LookupTable, StaysWithinItsProvenBound) {
  const RbfNetwork network = fit_ridge(samples(), values(Curve{7}, 0.46 * micrometre, 3)).network;
  const auto compiled = compile<1>(network, 5e-9);
  EXPECT_LE(compiled.bound, 5e-9);
  double worst = 0.0;
  for (double x = -0.01; x < 0.21; x += 1.3e-5)
    worst = std::max(worst, std::abs(compiled.table({x}) - network(x)));
  EXPECT_LE(worst, compiled.bound);
  EXPECT_GT(worst, 0.0);
}

TEST(LookupTable, ReproducesMultilinearFunctionsExactlyAndHoldsOutside) {
  const auto f = [](const std::array<double, 3>& x) {
    return 1.0 + 2.0 * x[0] - x[1] + 3.0 * x[0] * x[1] * x[2];
  };
  const LookupTable<3> table{{GridAxis{{0.0, 1.0}, 4}, GridAxis{{-1.0, 1.0}, 3}, GridAxis{{0.0, 2.0}, 5}}, f};
  EXPECT_NEAR(table({0.37, 0.61, 1.93}), f({0.37, 0.61, 1.93}), 1e-14);
  EXPECT_NEAR(table({-3.0, 9.0, 2.0}), f({0.0, 1.0, 2.0}), 1e-14);
  EXPECT_TRUE(std::isfinite(table({std::nan(""), 0.0, 0.0})));
}

TEST(LookupTable, SaysWhatBoundTheNodesSufficedFor) {
  const RbfNetwork network = fit_ridge(samples(), values(Curve{8}, 0.0, 1)).network;
  const auto coarse = compile<1>(network, 1e-12, 100);
  EXPECT_LE(coarse.table.size(), 101U);
  EXPECT_GT(coarse.bound, 1e-12);
}

}  // namespace
}  // namespace invar::numerics
