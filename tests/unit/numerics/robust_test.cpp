#include "core/numerics/robust.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

namespace invar::numerics {
namespace {

TEST(Robust, MedianAndDeviationIgnoreAThirdOfOutliers) {
  EXPECT_DOUBLE_EQ(median({3.0, 1.0, 2.0}), 2.0);
  EXPECT_DOUBLE_EQ(median({4.0, 1.0, 2.0, 3.0}), 2.5);
  EXPECT_TRUE(std::isnan(median({})));
  EXPECT_NEAR(robust_deviation({-1.0, 0.0, 1.0, 2.0, 1e9}, 1.0), 1.4826, 1e-12);
}

TEST(AndersonDarling, RejectsFivePercentOfNormalSamplesAtFivePercent) {
  std::mt19937 random{11};
  std::normal_distribution<double> normal{3.0, 0.2};
  int rejected = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    std::vector<double> sample(80);
    for (double& value : sample) value = normal(random);
    rejected += anderson_darling(sample).probability < 0.05 ? 1 : 0;
  }
  EXPECT_NEAR(rejected, 50, 25);
}

TEST(AndersonDarling, SeesAUniformDistributionAndAConstant) {
  std::vector<double> sample(200);
  for (std::size_t i = 0; i < sample.size(); ++i) sample[i] = static_cast<double>(i);
  EXPECT_LT(anderson_darling(sample).probability, 0.01);
  EXPECT_EQ(anderson_darling(std::vector<double>(20, 1.0)).probability, 0.0);
}

}  // namespace
}  // namespace invar::numerics
