#include "core/executor/pacer.hpp"

#include <gmock/gmock.h>

namespace invar {
namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr Instant start{1000 * ms};
constexpr Duration period{ms};

/// Instant of a number of periods after the start.
Instant at(double periods) { return {start.ns + static_cast<std::int64_t>(periods * 1e6)}; }

TEST(Pacer, CountsEveryPeriodWhenNothingIsLate) {
  Pacer pacer{period, OverrunPolicy::skip, 0, start};
  for (std::uint64_t k = 0; k < 5000; ++k) {
    ASSERT_EQ(pacer.cycle(), k);
    ASSERT_EQ(pacer.due(), at(static_cast<double>(k)));
    ASSERT_EQ(pacer.wake(pacer.due() + Duration{20'000}), 0U);
    ASSERT_FALSE(pacer.finish(pacer.due() + Duration{60'000}));
  }
  EXPECT_EQ(pacer.overruns(), 0U);
  EXPECT_EQ(pacer.skipped(), 0U);
}

TEST(Pacer, DoesNotDriftOverTenYearsOfCycles) {
  // 1/3 ms has no exact nanosecond count: what is kept exactly is the whole-nanosecond period.
  Pacer pacer{{333'333}, OverrunPolicy::skip, 0, start};
  const std::int64_t cycles = 10LL * 365 * 24 * 3600 * 3000;
  const Instant then = start + Duration{333'333} * cycles;
  EXPECT_EQ(pacer.wake(then), static_cast<std::uint64_t>(cycles));
  EXPECT_EQ(pacer.cycle(), static_cast<std::uint64_t>(cycles));
  EXPECT_EQ(pacer.due(), then);
}

TEST(Pacer, RunsTheNextCycleLateWhenTheWorkTookALittleTooLong) {
  Pacer pacer{period, OverrunPolicy::skip, 0, start};
  pacer.wake(at(0));
  EXPECT_TRUE(pacer.finish(at(1.2)));
  EXPECT_EQ(pacer.wake(at(1.2)), 0U);
  EXPECT_EQ(pacer.cycle(), 1U);
  EXPECT_FALSE(pacer.finish(at(1.3)));
  EXPECT_EQ(pacer.due(), at(2));
  EXPECT_EQ(pacer.overruns(), 1U);
  EXPECT_EQ(pacer.skipped(), 0U);
}

TEST(Pacer, LeavesOutWholePeriodsThatAreGoneAndKeepsThePhase) {
  Pacer pacer{period, OverrunPolicy::skip, 0, start};
  pacer.wake(at(0));
  EXPECT_TRUE(pacer.finish(at(3.4)));
  EXPECT_EQ(pacer.wake(at(3.4)), 2U);  // 1 and 2 are gone, 3 runs late
  EXPECT_EQ(pacer.cycle(), 3U);
  EXPECT_FALSE(pacer.finish(at(3.5)));
  EXPECT_EQ(pacer.wake(at(9.1)), 5U);  // woken too late: 4..8 are gone
  EXPECT_EQ(pacer.cycle(), 9U);
  EXPECT_EQ(pacer.overruns(), 2U) << "one event each";
  EXPECT_EQ(pacer.skipped(), 7U);
}

TEST(Pacer, SafeStopActsOnTheFirstLossBeyondTheToleratedOnesWithinASecond) {
  Pacer pacer{period, OverrunPolicy::safe_stop, 1, start};
  const auto lose = [&] {
    pacer.wake(pacer.due());
    pacer.finish(pacer.due() + Duration{ms + ms / 2});
  };
  lose();
  EXPECT_FALSE(pacer.take_stop());
  while (pacer.cycle() < 1500) {  // a second later that one is forgotten
    pacer.wake(pacer.due());
    pacer.finish(pacer.due());
  }
  lose();
  EXPECT_FALSE(pacer.take_stop());
  lose();
  EXPECT_TRUE(pacer.take_stop());
  EXPECT_FALSE(pacer.take_stop());
}

TEST(Pacer, DegradeHalvesTheRateDownToAnEighthAndReturnsWhenThereIsRoom) {
  Pacer pacer{period, OverrunPolicy::degrade, 0, start};
  const auto run = [&](double work_in_periods, int cycles) {
    for (int i = 0; i < cycles; ++i) {
      pacer.wake(pacer.due());
      pacer.finish(pacer.due() + Duration{static_cast<std::int64_t>(work_in_periods * 1e6)});
    }
  };
  run(1.5, 1);
  EXPECT_EQ(pacer.stretch(), 2U);
  run(1.5, 2000);
  EXPECT_EQ(pacer.stretch(), 2U) << "1.5 periods fit into two, but not into one";
  EXPECT_EQ(pacer.cycle() % 2, 0U);
  run(30.0, 5);
  EXPECT_EQ(pacer.stretch(), 8U);
  run(0.2, 2000);
  EXPECT_EQ(pacer.stretch(), 1U);
  EXPECT_EQ((pacer.due() - start).ns, static_cast<std::int64_t>(pacer.cycle()) * ms);
}

TEST(Pacer, TheCyclesThatADegradedLoopLeavesOutOnPurposeAreNotLost) {
  Pacer pacer{period, OverrunPolicy::degrade, 0, start};
  pacer.wake(pacer.due());
  pacer.finish(pacer.due() + Duration{ms + 1});
  ASSERT_EQ(pacer.stretch(), 2U);
  const std::uint64_t before = pacer.skipped();
  for (int i = 0; i < 100; ++i) {
    pacer.wake(pacer.due() + Duration{ms / 2});
    pacer.finish(pacer.due() + Duration{ms});
  }
  EXPECT_EQ(pacer.skipped(), before);
}

}  // namespace
}  // namespace invar
