// Whitening and robust spreads on noise whose colour is known.
#include "core/diagnosis/dataset/statistics.hpp"
#include "core/diagnosis/evidence/foretold.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

namespace invar::diagnosis {
namespace {

std::vector<double> coloured(double pole, unsigned seed, std::size_t n) {
  std::mt19937 random{seed};
  std::normal_distribution<double> normal;
  std::vector<double> values(n);
  double last = 0.0;
  for (double& v : values) v = last = pole * last + normal(random);
  return values;
}

std::vector<double> by_definition(const Whitening& filter, const std::vector<double>& r,
                                  const std::vector<bool>& present) {
  std::vector<double> filled(r.size()), white(r.size(), 0.0);
  for (std::size_t i = 0; i < r.size(); ++i) {
    double foretold = 0.0;
    for (std::size_t j = 0; j < filter.a.size() && j < i; ++j) foretold += filter.a[j] * filled[i - 1 - j];
    filled[i] = present[i] ? r[i] : foretold;
    if (present[i]) white[i] = (r[i] - foretold) / filter.sigma;
  }
  return white;
}

TEST(Whitening, FindsThePoleAndTheSizeOfAutoregressiveNoise) {
  const auto noise = coloured(0.8, 11, 20000);
  const auto filter = fit_whitening({noise}, 8);
  ASSERT_FALSE(filter.a.empty());
  EXPECT_NEAR(filter.a[0], 0.8, 0.03);
  EXPECT_NEAR(filter.sigma, 1.0, 0.03);
}

TEST(Median, OfWhatWasMeasuredAlone) {
  const double nothing = std::nan("");
  EXPECT_EQ(median({nothing, 3.0, nothing, 1.0, 2.0, nothing, nothing}), 2.0);
  EXPECT_NEAR(robust_sigma({1.0, nothing, 2.0, 3.0, nothing}), 1.4826, 1e-12);
  EXPECT_EQ(robust_sigma({nothing, nothing}), 0.0);
}

TEST(Whitening, LeavesWhiteNoiseAsItIs) {
  const auto filter = fit_whitening({coloured(0.0, 12, 20000)}, 8);
  EXPECT_LE(filter.a.size(), 3U);
  EXPECT_NEAR(filter.sigma, 1.0, 0.03);
}

TEST(Whitening, OfZerosOnlyZerosCome) {
  const Whitening filter{{0.7, -0.2, 0.1}, 2.0};
  std::vector<double> values(60, 0.0), white(60);
  std::vector<bool> present(60, true);
  for (const std::size_t i : {5U, 6U, 8U, 30U, 47U}) values[i] = static_cast<double>(i);
  for (const std::size_t i : {7U, 31U, 32U, 33U, 34U, 35U, 50U}) present[i] = false;
  whiten(filter, values, present, white.data());
  const auto expected = by_definition(filter, values, present);
  for (std::size_t i = 0; i < 60; ++i) {
    EXPECT_NEAR(white[i], expected[i], 1e-12) << i;
    if (expected[i] == 0.0) {
      EXPECT_EQ(white[i], 0.0) << i;
    }
  }
}

TEST(Whitening, MakesColouredNoiseWhite) {
  const auto noise = coloured(0.9, 13, 20000);
  const auto filter = fit_whitening({noise}, 8);
  std::vector<double> white(noise.size());
  whiten(filter, noise, std::vector<bool>(noise.size(), true), white.data());
  double square = 0.0, lagged = 0.0;
  for (std::size_t i = 1; i < white.size(); ++i)
    square += white[i] * white[i], lagged += white[i] * white[i - 1];
  EXPECT_NEAR(lagged / square, 0.0, 0.03);
}

TEST(RobustSigma, IsNotMovedByOutliers) {
  auto noise = coloured(0.0, 14, 5000);
  for (std::size_t i = 0; i < noise.size(); i += 50) noise[i] = 1000.0;
  EXPECT_NEAR(robust_sigma(noise), 1.0, 0.06);
}

TEST(IndependentShare, IsThatOfAFirstOrderMemory) {
  for (const double pole : {0.0, 0.6, 0.9}) {
    const double truth = (1.0 - pole) / (1.0 + pole);
    EXPECT_NEAR(independent_share({coloured(pole, 3, 20000), coloured(pole, 4, 20000)}), truth, 0.2 * truth)
        << pole;
  }
}

// Gaps at the beginning, short and long, zeros before and behind, and more rows than are taken at a time.
TEST(Whitening, IsTheRecursionWhateverIsMissing) {
  const Whitening filter{{0.5, -0.3, 0.2, 0.1}, 0.7};
  std::mt19937 random{7};
  std::normal_distribution<double> normal;
  std::vector<double> r(2600, 0.0);
  for (std::size_t i = 40; i < 2400; ++i) r[i] = normal(random);
  std::vector<bool> present(r.size(), true);
  for (const auto& [first, last] : {std::pair{0, 3}, std::pair{50, 51}, std::pair{53, 60},
                                    std::pair{900, 1300}, std::pair{2398, 2401}, std::pair{2500, 2502}})
    for (int i = first; i < last; ++i) present[static_cast<std::size_t>(i)] = false;
  for (const bool all : {false, true}) {
    if (all) present.assign(r.size(), true);
    std::vector<double> white(r.size(), -1.0);
    whiten(filter, r, present, white.data());
    EXPECT_THAT(white, testing::Pointwise(testing::DoubleNear(1e-12), by_definition(filter, r, present)));
  }
}

}  // namespace
}  // namespace invar::diagnosis
