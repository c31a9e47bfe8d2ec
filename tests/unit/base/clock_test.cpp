// The clock of stamps: UTC that follows what the host says without a jump.
#include "core/base/clock.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

namespace invar {
namespace {

constexpr Duration second = Duration::seconds(1.0);
constexpr Duration offset{1'790'000'000'000'000'000};

TEST(SlewedClock, AddsItsOffsetUntilItIsSet) {
  const SlewedClock clock{offset};
  for (const std::int64_t ns : {0LL, 1LL, 123'456'789'012LL}) EXPECT_EQ(clock.at({ns}).ns, offset.ns + ns);
}

TEST(SlewedClock, FollowsAStepForwardsByHalfAMillisecondASecond) {
  SlewedClock clock{offset};
  const Instant set = Instant{} + second * 100;
  clock.aim(offset + Duration::milliseconds(3), set);
  EXPECT_EQ(clock.at(set), set + offset);
  EXPECT_EQ(clock.at(set + second), set + second + offset + Duration::microseconds(500));
  EXPECT_EQ(clock.at(set + second * 6), set + second * 6 + offset + Duration::milliseconds(3));
  EXPECT_EQ(clock.at(set + second * 60), set + second * 60 + offset + Duration::milliseconds(3));
}

TEST(SlewedClock, NeverGoesBackWhenUtcDoes) {
  SlewedClock clock{offset};
  Instant monotonic = Instant{} + second;
  Instant last = clock.at(monotonic);
  for (int k = 0; k < 50'000; ++k) {
    // Set back by an hour, then to and fro while the offset is still on its way.
    if (k % 7'000 == 1) clock.aim(offset - second * 3600, monotonic);
    if (k % 7'000 == 3'500) clock.aim(offset + Duration::milliseconds(2), monotonic);
    monotonic += Duration::microseconds(100);
    const Instant next = clock.at(monotonic);
    EXPECT_GE((next - last).ns, 100'000 - 51);
    EXPECT_LE((next - last).ns, 100'000 + 51);
    last = next;
  }
}

TEST(SlewedClock, IsReadWholeWhileItIsSet) {
  SlewedClock clock{offset};
  const Instant far = Instant{} + second * 3600;
  const Duration way{second.ns * 3600 / SlewedClock::slew};
  std::atomic<bool> stop{false};
  std::thread setter{[&] {
    while (!stop) {  // to and fro: a beginning of the one with the target of the other leads beyond both ends
      clock.aim(offset + second * 3600, {});
      clock.aim(offset, far);
      clock.aim(offset - second * 3600, {});
      clock.aim(offset, far);
    }
  }};
  std::size_t moved = 0;
  for (int k = 0; k < 300'000 || (moved == 0 && k < 500'000'000); ++k) {
    const Duration away = clock.at(far) - far - offset;
    ASSERT_TRUE(away == Duration{} || away == way) << away.ns;
    if (away == way) ++moved;
  }
  stop = true;
  setter.join();
  EXPECT_GT(moved, 0U);
}

TEST(Utc, IsTheHostsAndAdvancesWithTheMonotonicClock) {
  const auto host = [] {
    return Instant{std::chrono::nanoseconds{std::chrono::system_clock::now().time_since_epoch()}.count()};
  };
  const Duration ahead = follow_utc();
  EXPECT_LT(ahead, Duration::seconds(1.0));
  EXPECT_GT(ahead, Duration::seconds(-1.0));
  const Instant before = host();
  const Instant now = utc_now();
  const Instant after = host();
  constexpr Duration steered = Duration::milliseconds(5);  // somebody may steer the host's clock meanwhile
  EXPECT_GE(now, before - steered);
  EXPECT_LE(now, after + steered);
  const Instant monotonic = monotonic_now();
  EXPECT_EQ(utc_at(monotonic + Duration::seconds(3.0)) - utc_at(monotonic), Duration::seconds(3.0));
}

}  // namespace
}  // namespace invar
