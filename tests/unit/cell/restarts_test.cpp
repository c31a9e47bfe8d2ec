// When a process that ended is started again.
#include "tools/cell/restarts.hpp"

#include <gmock/gmock.h>

namespace invar::tools {
namespace {

using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::ElementsAre;

std::vector<double> pauses(Restarts& restarts, double life, int times) {
  std::vector<double> seconds;
  for (int i = 0; i < times; ++i)
    seconds.push_back(restarts.ended_after(Duration::seconds(life)).in_seconds());
  return seconds;
}

TEST(Restarts, OneThatDiesAtOnceWaitsLongerAndLongerAndIsNeverGivenUp) {
  Restarts restarts;
  EXPECT_THAT(pauses(restarts, 0.1, 5), Each(0.0));
  EXPECT_THAT(pauses(restarts, 0.1, 7),
              ElementsAre(1.0, 2.0, 4.0, 8.0, 16.0, DoubleNear(30.0, 1e-6), DoubleNear(30.0, 1e-6)));
  EXPECT_THAT(pauses(restarts, 0.0, 1000), Each(DoubleNear(30.0, 1e-6)));
  EXPECT_EQ(restarts.count(), 1012U);
}

TEST(Restarts, OneThatRanWellForAMinuteStartsWithACleanCount) {
  Restarts restarts;
  pauses(restarts, 0.1, 20);
  EXPECT_THAT(pauses(restarts, 61.0, 1), Each(0.0));
  EXPECT_THAT(pauses(restarts, 0.1, 4), Each(0.0));
  EXPECT_THAT(pauses(restarts, 0.1, 1), Each(1.0));
}

TEST(Restarts, OneThatIsKilledNowAndThenIsAlwaysStartedAtOnce) {
  Restarts restarts;
  EXPECT_THAT(pauses(restarts, 13.0, 100), Each(0.0));  // five in a minute of running, day after day
}

}  // namespace
}  // namespace invar::tools
