// Histogram and snapshot: against sorting, and under a writer that does not wait.
#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <random>
#include <thread>

#include "core/executor/histogram.hpp"
#include "core/executor/snapshot.hpp"

namespace invar {
namespace {

TEST(Histogram, BucketsCoverEveryValueOnceAndAreAtMostAThirtySecondWide) {
  for (std::size_t i = 0; i < histogram::buckets; ++i) {
    const std::int64_t lower = histogram::lower_edge(i);
    const std::int64_t upper = histogram::lower_edge(i + 1);
    ASSERT_EQ(histogram::bucket_of(lower), i);
    ASSERT_EQ(histogram::bucket_of(upper - 1), i);
    ASSERT_LE(32 * (upper - lower - 1), lower);
  }
  EXPECT_EQ(histogram::bucket_of(-5), 0U);
  EXPECT_EQ(histogram::bucket_of(INT64_MAX), histogram::buckets - 1);
}

TEST(Histogram, QuantilesAgreeWithSortingWithinABucket) {
  const std::uint32_t seed = 20240607;
  std::printf("seed %u\n", seed);
  std::mt19937_64 random{seed};
  std::lognormal_distribution<double> latency{9.6, 1.2};  // median 15 us, long tail
  Histogram histogram;
  std::vector<std::int64_t> all;
  for (int i = 0; i < 50'000; ++i) {
    all.push_back(static_cast<std::int64_t>(latency(random)));
    histogram.add({all.back()});
  }
  std::sort(all.begin(), all.end());
  const HistogramCopy copy = histogram.copy();
  for (const double q : {0.01, 0.5, 0.9, 0.99, 0.999}) {
    const auto exact =
        static_cast<double>(all[static_cast<std::size_t>(q * static_cast<double>(all.size()))]);
    EXPECT_NEAR(static_cast<double>(copy.quantile(q).ns), exact, exact / 32.0 + 1.0) << q;
  }
  EXPECT_EQ(copy.max.ns, all.back());
  EXPECT_EQ(copy.quantile(1.0).ns, all.back());
  EXPECT_EQ(copy.percentiles().count, all.size());
}

TEST(Histogram, NothingCountedIsAllZeroAndADifferenceIsWhatCameBetween) {
  Histogram histogram;
  EXPECT_EQ(histogram.copy().percentiles().p99.ns, 0);
  histogram.add({100});
  const HistogramCopy before = histogram.copy();
  for (int i = 0; i < 10; ++i) histogram.add({2000});
  const HistogramCopy between = histogram.copy().since(before);
  EXPECT_EQ(between.count(), 10U);
  EXPECT_NEAR(static_cast<double>(between.quantile(0.5).ns), 2000.0, 2000.0 / 32.0);
  histogram.clear();
  EXPECT_EQ(histogram.copy().count(), 0U);
  EXPECT_EQ(histogram.copy().max.ns, 0);
}

TEST(Snapshot, ManyReadersNeverSeeATornValueWhileTheWriterGoesOn) {
  struct Wide {
    std::array<std::uint64_t, 9> words{};
  };
  Snapshot<Wide> snapshot;
  std::atomic<bool> done{false};
  std::vector<std::thread> readers;
  std::atomic<std::uint64_t> torn{0}, backwards{0};
  for (int r = 0; r < 3; ++r)
    readers.emplace_back([&] {
      std::uint64_t last = 0;
      while (!done) {
        const Wide value = snapshot.read();
        for (std::size_t i = 0; i < 9; ++i)
          if (value.words[i] != (value.words[0]) * (i + 1)) ++torn;
        if (value.words[0] < last) ++backwards;
        last = value.words[0];
      }
    });
  for (std::uint64_t k = 1; k <= 300'000; ++k) {
    Wide value;
    for (std::size_t i = 0; i < 9; ++i) value.words[i] = k * (i + 1);
    snapshot.write(value);
  }
  done = true;
  for (auto& reader : readers) reader.join();
  EXPECT_EQ(torn, 0U);
  EXPECT_EQ(backwards, 0U);
  EXPECT_EQ(snapshot.read().words[8], 300'000U * 9);
}

}  // namespace
}  // namespace invar
