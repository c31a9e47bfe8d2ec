// The rate of a topic: intervals over their sum, by the times at which the writer sent.
#include "tools/live/topic_watch.hpp"

#include <gmock/gmock.h>

namespace invar::tools {
namespace {

constexpr std::int64_t second = 1'000'000'000;

/// A writer whose clock is `ahead` of ours.
struct Writer {
  Flow flow;
  std::int64_t ahead = 0;
  std::uint64_t sequence = 0;
  void send(std::int64_t sent, std::int64_t arrives) {
    const std::vector<std::byte> bytes(100);
    flow.add({.cdr = bytes, .sent_ns = sent + ahead, .sequence = ++sequence, .writer = "w"}, arrives);
  }
};

TEST(Flow, TheRateIsThatOfSendingNotOfArriving) {
  Writer writer{.flow = {}, .ahead = 3600 * second};
  for (int i = 0; i < 101; ++i)
    writer.send(i * second / 100, (i / 20) * second / 5 + second);  // in bursts of twenty
  const Flow::Rate rate = writer.flow.rate_since({}, 3 * second);
  EXPECT_NEAR(rate.samples, 100.0, 1e-9);
  EXPECT_NEAR(rate.bytes, 10'000.0, 1e-6);
}

TEST(Flow, WhatWasKeptForLateComersCountsForNothing) {
  for (const std::int64_t ahead : {-10 * second, std::int64_t{0}, 10 * second}) {
    Writer writer{.flow = {}, .ahead = ahead};
    for (int i = 0; i < 1000; ++i) writer.send(i * second / 1000, 100 * second);  // of long ago, in one burst
    for (int i = 0; i < 11; ++i) writer.send(100 * second + i * second / 10, 100 * second + i * second / 10);
    EXPECT_EQ(writer.flow.samples, 11U);
    EXPECT_NEAR(writer.flow.rate_since({}, 102 * second).samples, 10.0, 1e-9);
    EXPECT_EQ(writer.flow.missing, 0U);
  }
}

TEST(Flow, OneLookCountsWhatCameSinceTheLookBefore) {
  Writer writer;
  for (int i = 0; i < 11; ++i) writer.send(i * second / 10, i * second / 10);
  const Flow before = writer.flow;
  for (int i = 1; i < 51; ++i) writer.send(second + i * second / 50, second + i * second / 50);
  EXPECT_NEAR(writer.flow.rate_since(before, 2 * second).samples, 50.0, 1e-9);
  EXPECT_NEAR(writer.flow.rate_since({}, 2 * second).samples, 30.0, 1e-9);
  // Slower than the looks: its rate stays until two intervals have passed in silence.
  Writer slow;
  for (int i = 0; i < 5; ++i) slow.send(i * 2 * second, i * 2 * second);
  EXPECT_NEAR(slow.flow.rate_since(slow.flow, 11 * second).samples, 0.5, 1e-9);
  EXPECT_EQ(slow.flow.rate_since(slow.flow, 13 * second).samples, 0.0);
}

TEST(Flow, RatesOfWritersAddUp) {
  Writer one, other;
  for (int i = 0; i < 11; ++i) one.send(i * second / 10, i * second / 10);
  for (int i = 0; i < 6; ++i) other.send(i * second / 5, i * second / 5);
  EXPECT_NEAR(rate_of({{"a", one.flow}, {"b", other.flow}}, {}, second).samples, 15.0, 1e-9);
}

}  // namespace
}  // namespace invar::tools
