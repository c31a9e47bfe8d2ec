// The executor by the clock: it starts, obeys, stops in order; nothing here depends on how fast the machine
// is.
#include <gmock/gmock.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <chrono>
#include <thread>

#include "core/base/clock.hpp"
#include "core/base/fault.hpp"
#include "core/executor/process_control.hpp"
#include "tests/unit/executor/toys.hpp"

namespace invar {
namespace {

using namespace toys;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

ExecutorOptions by_the_clock() {
  ExecutorOptions options;
  options.process = "test";
  return options;
}

TEST(Loop, RunsOnWholeMultiplesOfItsPeriodAndCountsEveryOne) {
  std::vector<Tick> ticks;
  ticks.reserve(100'000);
  Executor executor{by_the_clock()};
  executor.add(std::make_unique<Call>([&](const Tick& t) { ticks.push_back(t); }));
  executor.start();
  EXPECT_TRUE(executor.transition(0, Transition::configure).ok());
  EXPECT_TRUE(executor.transition(0, Transition::activate).ok());
  ASSERT_TRUE(eventually([&] { return executor.steps(0) >= 50; }));
  executor.stop();
  EXPECT_FALSE(executor.is_running());
  EXPECT_EQ(executor.state(0), LifecycleState::inactive);
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    EXPECT_EQ((ticks[i].now - utc_at({0})).ns % 1'000'000, 0);  // of the monotonic clock
    EXPECT_GT(ticks[i].cycle, ticks[i - 1].cycle);
    EXPECT_EQ((ticks[i].now - ticks[i - 1].now).ns,
              static_cast<std::int64_t>(ticks[i].cycle - ticks[i - 1].cycle) * 1'000'000);
  }
  const LoopCounters counters = executor.counters();
  EXPECT_EQ(counters.executed + counters.skipped, counters.cycle + 1);
  EXPECT_EQ(executor.wake_up().count(), counters.executed);
  EXPECT_EQ(executor.compute().count(), counters.executed);
}

TEST(Loop, TellsTheTimeInUtcAndStampsSamplesWithIt) {
  struct Stamped {
    std::uint32_t number = 0;
    void cell(std::uint32_t value) { number = value; }
    struct {
      std::int64_t ns = 0;
      std::uint64_t count = 0;
      void time_ns(std::int64_t value) { ns = value; }
      void cycle(std::uint64_t value) { count = value; }
    } stamp;
    auto& at() { return stamp; }
  } sample;
  const auto utc = [] {
    return Instant{std::chrono::nanoseconds{std::chrono::system_clock::now().time_since_epoch()}.count()};
  };
  constexpr Duration set_meanwhile =
      Duration::milliseconds(5);  // the host's clock may be steered while we look
  const Instant before = utc() - set_meanwhile;
  Executor executor{by_the_clock()};
  Tick last;
  Call* component = nullptr;
  auto owned = std::make_unique<Call>([&](const Tick& t) {
    last = t;
    component->stamp(sample);
  });
  component = owned.get();
  component->cell = 7;
  executor.add(std::move(owned));
  executor.start();
  EXPECT_TRUE(executor.transition(0, Transition::configure).ok());
  EXPECT_TRUE(executor.transition(0, Transition::activate).ok());
  ASSERT_TRUE(eventually([&] { return executor.steps(0) >= 3; }));
  EXPECT_LE(executor.counters().now, executor.now());
  executor.stop();
  EXPECT_GE(last.now, before);
  EXPECT_LE(last.now, utc() + set_meanwhile);
  EXPECT_EQ(sample.stamp.ns, last.now.ns);
  EXPECT_EQ(sample.stamp.count, last.cycle);
  EXPECT_EQ(sample.number, 7U);
}

TEST(Loop, ASlowProcessStopsAndObeysWithoutWaitingForItsNextCycle) {
  ExecutorOptions options = by_the_clock();
  options.period = Duration::seconds(60.0);
  Executor executor{options};
  executor.add(std::make_unique<Call>([](const Tick&) {}));
  executor.start();
  EXPECT_TRUE(executor.transition(0, Transition::configure).ok());
  EXPECT_TRUE(executor.transition(0, Transition::activate).ok());
  executor.stop();
  EXPECT_EQ(executor.counters().executed, 0U);
  EXPECT_EQ(executor.state(0), LifecycleState::inactive);
}

TEST(Loop, SaysWhatWasNotGrantedOrRefusesToRunAsDeclared) {
  ExecutorOptions options = by_the_clock();
  options.real_time = RealTimeRequest{.priority = 0, .cpu = 1000, .lock_memory = false, .require = false};
  {
    Executor executor{options};
    executor.start();
    const ProcessStatus status = ProcessControl{executor}.status();
    ASSERT_EQ(status.not_granted.size(), 1U);
    EXPECT_THAT(status.not_granted.front(),
                HasSubstr("realtime.cpu: core 1000 not granted (Invalid argument)"));
  }
  options.real_time->require = true;
  Executor executor{options};
  try {
    executor.start();
    FAIL() << "it ran";
  } catch (const InputError& error) {
    ASSERT_EQ(error.faults().size(), 1U);
    EXPECT_THAT(
        error.faults().front().line(),
        HasSubstr("process test: realtime.cpu: core 1000 not granted (Invalid argument); name a core"));
  }
  EXPECT_FALSE(executor.is_running());
}

TEST(Loop, HasThePriorityThatItsGrantsSayItHas) {
  ExecutorOptions options = by_the_clock();
  options.real_time = RealTimeRequest{.priority = 7, .cpu = 0, .lock_memory = true, .require = false};
  std::atomic<int> policy{-1}, priority{-1}, cores{-1}, core{-1};
  Executor executor{options};
  executor.add(std::make_unique<Call>([&](const Tick&) {
    sched_param parameters{};
    int p = -1;
    pthread_getschedparam(pthread_self(), &p, &parameters);
    cpu_set_t set;
    sched_getaffinity(0, sizeof set, &set);
    policy = p;
    priority = parameters.sched_priority;
    cores = CPU_COUNT(&set);
    core = sched_getcpu();
  }));
  (void)executor.transition(0, Transition::configure);
  (void)executor.transition(0, Transition::activate);
  executor.start();
  ASSERT_TRUE(eventually([&] { return executor.steps(0) > 3; }));
  executor.stop();
  munlockall();
  ASSERT_EQ(executor.grants().size(), 4U);
  for (const Grant& grant : executor.grants()) {
    EXPECT_EQ(grant.why.empty(), grant.granted) << grant.what;
    if (grant.setting == "realtime.priority") {
      EXPECT_EQ(policy == SCHED_FIFO && priority == 7, grant.granted);
    }
    if (grant.setting == "realtime.cpu") {
      EXPECT_EQ(cores == 1 && core == 0, grant.granted);
    }
  }
}

TEST(Loop, DoesNotBlameAnInputForItsOwnStandstillButStillMissesOneThatIsGone) {
  // The servo stands before the plant: what it reads is a cycle old, and older by the standstill.
  Plant* plant = nullptr;
  Servo* servo = nullptr;
  const Servo::Parameters parameters;
  std::atomic<bool> stall{false};
  Executor executor{by_the_clock()};
  auto a = std::make_unique<Servo>(parameters);
  auto b = std::make_unique<Plant>();
  servo = a.get();
  plant = b.get();
  plant->position.connect(servo->position);
  servo->force.connect(plant->force);
  executor.add(std::move(a));
  executor.add(std::move(b));
  executor.add(std::make_unique<Call>([&](const Tick&) {
    if (stall.exchange(false)) std::this_thread::sleep_for(std::chrono::milliseconds{30});
  }));
  for (std::size_t i = 0; i < 3; ++i) {
    (void)executor.transition(i, Transition::configure);
    (void)executor.transition(i, Transition::activate);
  }
  executor.start();
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(eventually([&, then = executor.steps(0)] { return executor.steps(0) > then + 5; }));
    stall = true;
    ASSERT_TRUE(eventually([&] { return !stall; }));
  }
  ASSERT_TRUE(eventually([&, then = executor.steps(0)] { return executor.steps(0) > then + 5; }));
  EXPECT_GT(executor.counters().skipped, 3U * 20U);
  EXPECT_EQ(executor.state(0), LifecycleState::active) << executor.failure(0);
  EXPECT_TRUE(executor.transition(1, Transition::deactivate).ok());
  ASSERT_TRUE(eventually([&] { return executor.state(0) == LifecycleState::error; }));
  EXPECT_THAT(executor.failure(0), HasSubstr("input `position` lost"));
}

TEST(Loop, DegradesToALowerRateAndTellsItsStepsTheLongerPeriod) {
  ExecutorOptions options = by_the_clock();
  options.overrun = OverrunPolicy::degrade;
  std::atomic<bool> busy{true};
  std::atomic<double> period{0.0}, own{0.0};
  Executor executor{options};
  executor.add(std::make_unique<Call>([&](const Tick& t) {
    period = t.period;
    own = t.own_period;
    if (busy) std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }));
  (void)executor.transition(0, Transition::configure);
  (void)executor.transition(0, Transition::activate);
  executor.start();
  ASSERT_TRUE(eventually([&] { return executor.counters().stretch == 8; }));
  ASSERT_TRUE(eventually([&] { return period == 8e-3; }));
  EXPECT_EQ(own, 1e-3);
  EXPECT_FALSE(executor.counters().tripped);
  executor.stop();
}

TEST(Loop, ALostPeriodUnderSafeStopDeactivatesEverything) {
  ExecutorOptions options = by_the_clock();
  options.overrun = OverrunPolicy::safe_stop;
  options.tolerated = 1'000'000;  // the host may be slow; only the test's own hang must count
  Executor tolerant{options};
  options.tolerated = 0;
  Executor strict{options};
  for (Executor* executor : {&tolerant, &strict}) {
    executor->add(std::make_unique<Call>([](const Tick& t) {
      if (t.cycle > 5) std::this_thread::sleep_for(std::chrono::milliseconds{3});
    }));
    (void)executor->transition(0, Transition::configure);
    (void)executor->transition(0, Transition::activate);
    executor->start();
    ASSERT_TRUE(eventually([&] { return executor->counters().cycle > 50; }));
    const bool strictly = executor == &strict;
    EXPECT_EQ(executor->counters().tripped, strictly);
    EXPECT_EQ(executor->state(0), strictly ? LifecycleState::inactive : LifecycleState::active);
    EXPECT_GT(executor->counters().overruns, 0U);
    executor->stop();
  }
}

TEST(Loop, BrakesBeforeItDeactivatesOnRequestAndWhenItEnds) {
  Track track{by_the_clock()};
  track.executor.start();
  ProcessControl control{track.executor};
  EXPECT_EQ(control.request("all", Transition::deactivate, 7).verdict, Verdict::done);
  EXPECT_EQ(track.states(), "---");
  EXPECT_EQ(track.runner->speed, 0);
  track.runner->speed = 20;
  EXPECT_EQ(control.request("all", Transition::activate, 8).verdict, Verdict::done);
  EXPECT_EQ(control.request("all", Transition::deactivate, 7).verdict, Verdict::done) << "as before";
  EXPECT_EQ(track.states(), "aaa");
  track.executor.stop();
  EXPECT_EQ(track.states(), "---");
  EXPECT_EQ(track.runner->speed, 0);
}

TEST(ProcessControl, BringsUpUpstreamFirstAndTakesDownDownstreamFirstOncePerRequestId) {
  std::vector<std::string> journal;
  Executor executor{by_the_clock()};
  // Declared against the flow: the listener stands first.
  struct Source final : Component {
    Output<Sample> out{*this, "out"};
    std::vector<std::string>* journal = nullptr;
    void step(const Tick&) noexcept override {}
    void configure() override { journal->push_back("configure " + name); }
    void activate() override { journal->push_back("activate " + name); }
    void deactivate() noexcept override { journal->push_back("deactivate " + name); }
    void cleanup() noexcept override { journal->push_back("cleanup " + name); }
  };
  struct Sink final : Component {
    Input<Sample> in{*this, "in"};
    std::vector<std::string>* journal = nullptr;
    void step(const Tick&) noexcept override {}
    void configure() override { journal->push_back("configure " + name); }
    void activate() override { journal->push_back("activate " + name); }
    void deactivate() noexcept override { journal->push_back("deactivate " + name); }
    void cleanup() noexcept override { journal->push_back("cleanup " + name); }
  };
  auto sink = std::make_unique<Sink>();
  auto source = std::make_unique<Source>();
  sink->name = "sink";
  source->name = "source";
  sink->journal = source->journal = &journal;
  source->out.topic = sink->in.topic = "cell/a/source/out";
  executor.add(std::move(sink));
  executor.add(std::move(source));
  executor.start();
  ProcessControl control{executor};
  EXPECT_EQ(control.request("all", Transition::configure, 1).verdict, Verdict::done);
  EXPECT_EQ(control.request("", Transition::activate, 2).verdict, Verdict::done);
  EXPECT_EQ(control.request("", Transition::activate, 2).verdict, Verdict::done) << "as before";
  EXPECT_EQ(control.request("", Transition::activate, 3).verdict, Verdict::already);
  EXPECT_THAT(control.request("surce", Transition::activate, 4).reason, HasSubstr("did you mean `source`?"));
  control.stop();
  EXPECT_THAT(journal, ElementsAre("configure source", "configure sink", "activate source", "activate sink",
                                   "deactivate sink", "cleanup sink", "deactivate source", "cleanup source"));
  EXPECT_EQ(executor.state(0), LifecycleState::finalized);
}

TEST(ProcessControl, BringingUpStopsAtTheFirstThatFailsAndTakingDownCarriesOn) {
  Loop loop{by_the_clock()};
  ProcessControl control{loop.executor};
  loop.servo->refuse_to_configure = true;
  const Outcome outcome = control.request("all", Transition::configure);
  EXPECT_EQ(outcome.verdict, Verdict::failed);
  EXPECT_EQ(outcome.reason, "servo: no such device");
  EXPECT_EQ(outcome.state, LifecycleState::error);
  EXPECT_EQ(loop.executor.state(0), LifecycleState::inactive);
  EXPECT_EQ(loop.executor.state(2), LifecycleState::unconfigured) << "downstream of what failed";
  EXPECT_EQ(control.request("all", Transition::configure).verdict, Verdict::refused) << "reset it first";
  loop.servo->refuse_to_configure = false;
  EXPECT_TRUE(control.request("all", Transition::reset).ok());
  EXPECT_TRUE(control.request("all", Transition::configure).ok());
  EXPECT_TRUE(control.request("all", Transition::activate).ok());
  EXPECT_EQ(control.request("all", Transition::configure).verdict, Verdict::already);
  EXPECT_EQ(control.request("all", Transition::activate).state, LifecycleState::active);
  EXPECT_TRUE(control.request("all", Transition::shutdown).ok());
  EXPECT_EQ(control.request("all", Transition::activate).verdict, Verdict::refused);
}

TEST(ProcessControl, ConvertsUnitsAndReportsEverythingAStatusNeeds) {
  Loop loop{by_the_clock()};
  ProcessControl control{loop.executor};
  EXPECT_TRUE(control.request("all", Transition::configure).ok());
  EXPECT_TRUE(control.request("all", Transition::activate).ok());
  loop.executor.start();
  ASSERT_TRUE(eventually([&] { return loop.executor.steps(1) > 10; }));
  EXPECT_EQ(control.set_parameter("servo", "gain", 0.0002, "1/ms2"), "");
  EXPECT_THAT(control.set_parameter("servo", "gain", 1.0, "m"), HasSubstr("`m` is no unit of it; give 1/s2"));
  const auto parameters = control.parameters("servo");
  ASSERT_EQ(parameters.size(), 2U);
  EXPECT_NEAR(*parameters[0].value, 200.0, 1e-9);
  EXPECT_FALSE(parameters[1].value);
  const ProcessStatus status = control.status();
  EXPECT_TRUE(status.running);
  ASSERT_EQ(status.components.size(), 3U);
  EXPECT_EQ(status.components[1].type, "servo");
  EXPECT_GT(status.components[1].compute.count, 0U);
  EXPECT_GT(status.wake_up.count, 0U);
  EXPECT_LE(status.compute.p50, status.compute.max);
}

}  // namespace
}  // namespace invar
