// Percentiles of the last seconds beside those since the start.
#include "core/executor/recent.hpp"

#include <gmock/gmock.h>

namespace invar {
namespace {

HistogramCopy with(HistogramCopy histogram, std::int64_t microseconds, int times) {
  for (int i = 0; i < times; ++i) histogram.add(Duration::microseconds(microseconds));
  return histogram;
}

TEST(RecentHistogram, ForgetsWhatIsOlderThanTwoTurns) {
  RecentHistogram recent;
  const HistogramCopy slow = with({}, 5000, 1000);
  EXPECT_NEAR(static_cast<double>(recent.since_older(slow).p50.ns), 5e6, 0.04 * 5e6);
  recent.turn(slow);
  const HistogramCopy mixed = with(slow, 10, 1000);
  EXPECT_EQ(recent.since_older(mixed).count, 2000U);  // the first window reaches back to the start
  recent.turn(mixed);
  const HistogramCopy fast = with(mixed, 10, 1000);
  const Percentiles now = recent.since_older(fast);
  EXPECT_EQ(now.count, 2000U);
  EXPECT_NEAR(static_cast<double>(now.p99.ns), 10e3, 0.04 * 10e3);
  EXPECT_LT(now.max.ns, 11'000);  // not the 5 ms of before
  EXPECT_GT(fast.percentiles().p99.ns, 4'000'000);
}

TEST(RecentHistogram, NothingCountedIsNothing) {
  RecentHistogram recent;
  const HistogramCopy all = with({}, 100, 5);
  recent.turn(all);
  recent.turn(all);
  EXPECT_EQ(recent.since_older(all).count, 0U);
  EXPECT_EQ(recent.since_older(all).max.ns, 0);
}

}  // namespace
}  // namespace invar
