// What moved between calibrations, and when the next is due, against machines whose drift is known.
#include "tools/history/drift.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <random>

namespace invar::tools {
namespace {

constexpr double day = 86400.0;
using Numbers = std::vector<CalibratedNumber>;

/// Nine places of one error, known to `sigma`, that moves by `rate` a day and wanders.
struct Machine {
  double sigma = 1e-7, rate = 0.0, wander = 0.0;  // m, m/day, m a root of a day
  unsigned seed = 1;

  std::vector<Numbers> calibrated(const std::vector<double>& times) const {
    std::mt19937 random{seed};
    std::normal_distribution<double> normal;
    std::vector<Numbers> all;
    std::vector<double> truth(9, 0.0);
    for (std::size_t i = 0; i < times.size(); ++i) {
      Numbers numbers;
      for (std::size_t k = 0; k < truth.size(); ++k) {
        if (i > 0)
          truth[k] += rate * (times[i] - times[i - 1]) / day +
                      wander * std::sqrt((times[i] - times[i - 1]) / day) * normal(random);
        numbers.push_back({"error", std::to_string(k), "m", truth[k] + sigma * normal(random), sigma, true});
      }
      all.push_back(std::move(numbers));
    }
    return all;
  }
};

std::vector<double> each(double days, int count) {
  std::vector<double> times;
  for (int i = 0; i < count; ++i) times.push_back(1e9 + i * days * day);
  return times;
}

TEST(Drift, IsSaidWhereItIsMoreThanChance) {
  int called = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    const auto still = histories_of(Machine{.seed = seed}.calibrated(each(30, 4)), each(30, 4));
    called += still.front().verdict == NameHistory::Verdict::moved ? 1 : 0;
    const auto moves = histories_of(Machine{.rate = 2e-8, .seed = seed}.calibrated(each(30, 4)), each(30, 4));
    EXPECT_EQ(moves.front().verdict, NameHistory::Verdict::moved) << seed;  // 1.8 um, sigma 0.14 um
  }
  EXPECT_LE(called, 6);  // one in a hundred
}

TEST(Drift, IsDueWhenTheLineReachesTheAccuracy) {
  // 20 nm a day from 0.1 um of sigma: two sigma reach 4 um when the drift is 2 um, after 100 days.
  const auto names = histories_of(Machine{.rate = 2e-8}.calibrated(each(30, 6)), each(30, 6));
  const Due due = due_for(names, 4e-6);
  ASSERT_TRUE(due.known);
  EXPECT_NEAR(due.after / day, 100.0, 8.0);
  EXPECT_EQ(due.by, "error");
  EXPECT_EQ(due_for(names, 1e-7).after, 0.0);  // the calibration itself is known to 0.2 um
  EXPECT_NEAR(due.left, 2e-7, 1e-12);
}

TEST(Drift, OfAWanderingMachineIsDueBeforeItsErrorIsLarger) {
  // Against many machines: at the due time the true error since the last calibration must be within the accuracy.
  int within = 0, total = 0;
  for (unsigned seed = 1; seed <= 100; ++seed) {
    const Machine machine{.sigma = 5e-8, .wander = 1e-7, .seed = seed};
    const auto times = each(20, 8);
    const Due due = due_for(histories_of(machine.calibrated(times), times), 2e-6);
    ASSERT_TRUE(due.known);
    std::mt19937 random{seed + 1000};
    std::normal_distribution<double> normal;
    for (int k = 0; k < 9; ++k) {
      const double off = std::hypot(5e-8, 1e-7 * std::sqrt(due.after / day)) * normal(random);
      within += std::abs(off) <= 2e-6 ? 1 : 0;
      ++total;
    }
    EXPECT_GT(due.after, 5.0 * day) << seed;  // nor is it called due at once
  }
  EXPECT_GT(within, 0.93 * total);
}

TEST(Drift, WithoutSigmasNothingIsCalledMoved) {
  auto numbers = Machine{.rate = 1e-6}.calibrated(each(30, 3));
  for (auto& calibration : numbers)
    for (auto& one : calibration) one.sigma = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(histories_of(numbers, each(30, 3)).front().verdict, NameHistory::Verdict::not_known);
}

TEST(Drift, OfOneCalibrationIsNotKnown) {
  const auto names = histories_of(Machine{}.calibrated(each(30, 1)), each(30, 1));
  EXPECT_FALSE(due_for(names, 1e-6).known);
}

}  // namespace
}  // namespace invar::tools
