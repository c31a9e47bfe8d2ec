#include "core/modbus/backoff.hpp"

#include <gmock/gmock.h>

namespace invar::modbus {
namespace {

constexpr Instant at_ms(std::int64_t ms) { return Instant{} + Duration::milliseconds(ms); }

TEST(Backoff, DoublesTheWaitUpToItsLimitAndBeginsAnewAfterASuccess) {
  Backoff backoff{Duration::milliseconds(100), Duration::milliseconds(350)};
  EXPECT_TRUE(backoff.may_try(at_ms(0)));
  std::int64_t now = 0;
  for (const int wait : {100, 200, 350, 350}) {
    backoff.failed(at_ms(now));
    EXPECT_FALSE(backoff.may_try(at_ms(now + wait - 1)));
    EXPECT_TRUE(backoff.may_try(at_ms(now + wait)));
    now += wait;
  }
  backoff.succeeded();
  EXPECT_TRUE(backoff.may_try(at_ms(now)));
  backoff.failed(at_ms(now));
  EXPECT_EQ(backoff.retry_at(), at_ms(now + 100));
}

}  // namespace
}  // namespace invar::modbus
