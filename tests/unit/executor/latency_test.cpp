// Declared latencies: of the loop, and of the samples that components read. What is late here is late by what the test does,
// however fast the machine is; limits that must hold are longer than any machine takes.
#include <gmock/gmock.h>

#include <chrono>
#include <thread>

#include "core/base/clock.hpp"
#include "core/executor/process_control.hpp"
#include "tests/unit/executor/toys.hpp"

namespace invar {
namespace {

using toys::Call;
using toys::eventually;

struct StampedSample {
  struct Stamp {
    std::int64_t ns = 0;
    [[nodiscard]] std::int64_t time_ns() const { return ns; }
  } stamp;
  [[nodiscard]] const Stamp& at() const { return stamp; }
};

struct Reader final : Component {
  Input<StampedSample> signal{*this, "signal"};
  Input<StampedSample> unwatched{*this, "unwatched"};
  void step(const Tick&) noexcept override {}
};

ExecutorOptions options(std::optional<Duration> latency, LatePolicy late) {
  ExecutorOptions out;
  out.process = "test";
  out.period = Duration::milliseconds(20);
  out.late = late;
  out.real_time = RealTimeRequest{};
  out.real_time->latency = latency;
  return out;
}

void bring_up(Executor& executor) {
  ASSERT_TRUE(executor.transition(0, Transition::configure).ok());
  ASSERT_TRUE(executor.transition(0, Transition::activate).ok());
}

/// Works for three milliseconds.
std::unique_ptr<Call> slow() {
  return std::make_unique<Call>([](const Tick&) {
    const Instant end = monotonic_now() + Duration::milliseconds(3);
    while (monotonic_now() < end) {
    }
  });
}

TEST(Latency, OfACycleIsFromItsDueTimeToTheEndOfItsWorkAndCountedWhenItIsLate) {
  Executor executor{options(Duration::milliseconds(2), LatePolicy::event)};
  executor.add(slow());
  executor.start();
  bring_up(executor);
  ASSERT_TRUE(eventually([&] { return executor.steps(0) >= 5; }));
  executor.stop();
  const LoopCounters counters = executor.counters();
  EXPECT_GE(counters.late, 5U);
  EXPECT_LE(counters.late, counters.executed);
  const ProcessStatus status = ProcessControl{executor}.status();
  EXPECT_EQ(status.latency_limit, Duration::milliseconds(2));
  EXPECT_EQ(status.latency.count, counters.executed);
  EXPECT_GE(status.latency.max, Duration::milliseconds(3));
  EXPECT_GE(status.latency.max, status.compute.max);
  EXPECT_TRUE(status.trip_reason.empty());
}

TEST(Latency, IsCountedOnlyWhereItIsDeclared) {
  Executor executor{options(std::nullopt, LatePolicy::safe_stop)};
  executor.add(slow());
  executor.start();
  bring_up(executor);
  ASSERT_TRUE(eventually([&] { return executor.steps(0) >= 3; }));
  executor.stop();
  EXPECT_EQ(executor.counters().late, 0U);
  EXPECT_FALSE(executor.counters().tripped);
}

TEST(Latency, OfACycleStopsTheProcessSafelyWhereThatIsDeclared) {
  Executor executor{options(Duration::milliseconds(2), LatePolicy::safe_stop)};
  executor.add(slow());
  executor.start();
  (void)executor.transition(0, Transition::configure);
  (void)executor.transition(0, Transition::activate);  // refused where a starved loop was late before
  ASSERT_TRUE(eventually([&] { return executor.counters().tripped; }));
  EXPECT_EQ(executor.trip_reason(), "a cycle ended later than its declared latency");
  EXPECT_NE(executor.state(0), LifecycleState::active);
  executor.stop();
}

struct Fed {
  Fed(LatePolicy late, Duration limit) : executor{options(std::nullopt, late)} {
    auto owned = std::make_unique<Reader>();
    reader = owned.get();
    reader->name = "reader";
    executor.add(std::move(owned), {.type = "reader",
                                    .parameters = {},
                                    .storage = nullptr,
                                    .every = 1,
                                    .latencies = {{"signal", limit}}});
    executor.start();
  }
  Executor executor;
  Reader* reader = nullptr;
};

TEST(Latency, OfASampleIsItsAgeByItsStampWhenItIsRead) {
  Fed fed{LatePolicy::event, Duration::seconds(100.0)};
  bring_up(fed.executor);
  ASSERT_TRUE(eventually([&] { return fed.executor.steps(0) >= 3; }));
  EXPECT_EQ(fed.executor.ages(0).at(0).age.count, 0U);  // nothing arrived yet
  fed.reader->signal.accept({{(utc_now() - Duration::seconds(1.0)).ns}}, utc_now());
  ASSERT_TRUE(eventually([&] { return fed.executor.ages(0).at(0).age.count >= 2; }));
  const InputAge young = fed.executor.ages(0).at(0);
  EXPECT_EQ(young.port, "signal");
  EXPECT_EQ(young.late, 0U);
  EXPECT_GE(young.age.p50, Duration::seconds(0.97));  // a bucket of the histogram is 1/32 wide
  fed.reader->signal.accept({{(utc_now() - Duration::seconds(1000.0)).ns}}, utc_now());
  ASSERT_TRUE(eventually([&] { return fed.executor.ages(0).at(0).late >= 2; }));
  EXPECT_GE(fed.executor.ages(0).at(0).age.max, Duration::seconds(1000.0));
  EXPECT_EQ(fed.executor.state(0), LifecycleState::active);
  EXPECT_EQ(fed.executor.ages(0).size(), 1U);
  fed.executor.stop();
}

TEST(Latency, OfASampleStopsTheProcessSafelyWhereThatIsDeclared) {
  Fed fed{LatePolicy::safe_stop, Duration::seconds(100.0)};
  bring_up(fed.executor);
  fed.reader->signal.accept({{(utc_now() - Duration::seconds(1000.0)).ns}}, utc_now());
  ASSERT_TRUE(eventually([&] { return fed.executor.state(0) == LifecycleState::inactive; }));
  EXPECT_EQ(fed.executor.trip_reason(), "an input's sample is older than its declared latency");
  fed.executor.stop();
}

}  // namespace
}  // namespace invar
