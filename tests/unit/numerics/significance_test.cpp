// Significance: published quantiles, and how often chance alone is called a pattern.
#include "core/numerics/significance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace invar::numerics {
namespace {

TEST(FTail, HasThePublishedQuantiles) {
  // Tables of the F distribution.
  EXPECT_NEAR(f_tail(3.3258, 5, 10), 0.05, 1e-5);
  EXPECT_NEAR(f_tail(161.4476, 1, 1), 0.05, 1e-6);
  EXPECT_NEAR(f_tail(6.9266, 2, 12), 0.01, 1e-6);
  EXPECT_NEAR(f_tail(1.0, 7, 7), 0.5, 1e-12);
  EXPECT_NEAR(f_tail(1.5343, 30, 120), 0.056, 2e-3);
  EXPECT_EQ(f_tail(0.0, 3, 4), 1.0);
}

TEST(FTail, IsThatOfStudentsTSquared) {
  // t of 4 degrees of freedom: P(|t| > 2) in closed form, with s = t / sqrt(t^2 + 4).
  const double s = 2.0 / std::sqrt(8.0);
  EXPECT_NEAR(f_tail(4.0, 1, 4), 1.0 - 1.5 * (s - s * s * s / 3.0), 1e-12);
}

TEST(AlikeNeighbours, AreCalledRarelyInNoiseAndSurelyInAWave) {
  std::mt19937 random{1};
  std::normal_distribution<double> normal;
  int called = 0;
  constexpr int trials = 1000;
  for (int k = 0; k < trials; ++k) {
    std::vector<double> values(40);
    for (double& value : values) value = normal(random);
    called += chance_of_alike_neighbours(values) < 0.05 ? 1 : 0;
  }
  EXPECT_GT(called, 0.02 * trials);
  EXPECT_LT(called, 0.08 * trials);
  std::vector<double> wave(40);
  for (std::size_t i = 0; i < wave.size(); ++i) wave[i] = std::sin(0.3 * static_cast<double>(i));
  EXPECT_LT(chance_of_alike_neighbours(wave), 1e-6);
  EXPECT_EQ(chance_of_alike_neighbours({1.0, 2.0, 3.0}), 1.0);
}

}  // namespace
}  // namespace invar::numerics
