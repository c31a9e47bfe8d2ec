#include "core/dds/process_service.hpp"

#include <gmock/gmock.h>

#include "core/base/clock.hpp"
#include "core/component/registry.hpp"
#include "domain.hpp"
#include "idl/stage.h"

namespace invar::dds {
namespace {

using testing::eventually;
using ::testing::HasSubstr;
using testing::local;

class Counter final : public Component {
 public:
  struct Parameters {
    double gain = 1.0;
    double fixed = 2.0;
    void describe(auto& p) {
      p(gain, "gain", "m/s", Range{0.0, 10.0}, "gain of the loop", while_running);
      p(fixed, "fixed", "1", Range{0.0, 10.0}, "set before the start");
    }
  };
  explicit Counter(const Parameters& parameters) : parameters_{parameters} {}
  void step(const Tick&) noexcept override {}

 private:
  [[maybe_unused]] const Parameters& parameters_;
};

const Duration patience = Duration::milliseconds(20'000);

class Service : public ::testing::Test {
 protected:
  Service() : executor{options()}, control{executor} {
    Registry registry;
    registry.add<Counter>("counter", "counts");
    for (const char* name : {"first", "second"}) {
      const auto yaml = config::Yaml::parse("gain: 3\n", "a.yaml");
      const auto prepared = registry.prepare("counter", yaml.root(), {});
      auto component = prepared.make();
      component->name = name;
      component->id = executor.size() == 0 ? 1 : 2;
      executor.add(std::move(component),
                   {.type = "counter", .parameters = prepared.infos, .storage = prepared.parameters});
    }
    executor.start();
  }
  ~Service() override { executor.stop(); }
  static ExecutorOptions options() {
    ExecutorOptions o;
    o.process = "motion";
    o.period = Duration::milliseconds(5);
    return o;
  }
  Executor executor;
  ProcessControl control;
};

TEST_F(Service, StatusTransitionsAndParametersGoOverTheWire) {
  Node node{local("motion"), standard_profiles()};
  std::atomic<bool> asked_to_stop{false};
  ProcessService::Options service_options;
  service_options.cell = 1;
  service_options.host = "pc";
  service_options.interval = Duration::milliseconds(50);
  service_options.stop_process = [&] { asked_to_stop = true; };
  ProcessService service{node, control, service_options};
  service.start();
  Node tool{local("tool"), standard_profiles()};
  CellClient client{tool};

  ASSERT_TRUE(eventually([&] { return client.components().size() == 2 && client.processes().size() == 1; }));
  EXPECT_EQ(client.process_of("first"), "motion");
  EXPECT_EQ(client.components()[0].state(), lifecycle::STATE_UNCONFIGURED);
  EXPECT_STREQ(client.processes()[0].host().c_str(), "pc");
  EXPECT_DOUBLE_EQ(client.processes()[0].rate(), 200.0);

  const auto configured = client.request("motion", "", lifecycle::TRANSITION_CONFIGURE, patience);
  ASSERT_TRUE(configured.has_value());
  EXPECT_TRUE(configured->done()) << configured->text().c_str();
  const auto activated = client.request("motion", "first", lifecycle::TRANSITION_ACTIVATE, patience);
  ASSERT_TRUE(activated.has_value());
  EXPECT_EQ(activated->state(), lifecycle::STATE_ACTIVE);
  ASSERT_TRUE(eventually([&] { return client.components()[0].state() == lifecycle::STATE_ACTIVE; }));
  EXPECT_EQ(executor.state(0), LifecycleState::active);
  EXPECT_EQ(executor.state(1), LifecycleState::inactive);

  const auto refused = client.request("motion", "second", lifecycle::TRANSITION_CLEANUP, patience);
  ASSERT_TRUE(refused.has_value());
  const auto unknown = client.request("motion", "third", lifecycle::TRANSITION_ACTIVATE, patience);
  ASSERT_TRUE(unknown.has_value());
  EXPECT_FALSE(unknown->done());
  EXPECT_THAT(unknown->text().c_str(), HasSubstr("third"));

  const auto list = client.parameter("motion", "first", lifecycle::PARAMETER_LIST, "", "", patience);
  ASSERT_TRUE(list.has_value());
  ASSERT_EQ(list->parameters().size(), 2U);
  EXPECT_STREQ(list->parameters()[0].path().c_str(), "gain");
  EXPECT_STREQ(list->parameters()[0].value().c_str(), "3");
  EXPECT_TRUE(list->parameters()[0].changeable());
  const auto set =
      client.parameter("motion", "first", lifecycle::PARAMETER_SET, "gain", "4500 mm/s", patience);
  ASSERT_TRUE(set.has_value());
  EXPECT_TRUE(set->done()) << set->text().c_str();
  EXPECT_EQ(executor.parameter(0, "gain"), 4.5);
  for (const auto& [path, value] :
       {std::pair{"gain", "11"}, {"gain", "fast"}, {"fixed", "3"}, {"gian", "1"}}) {
    const auto wrong = client.parameter("motion", "first", lifecycle::PARAMETER_SET, path, value, patience);
    ASSERT_TRUE(wrong.has_value());
    EXPECT_FALSE(wrong->done()) << path << " = " << value;
    EXPECT_NE(wrong->text().size(), 0U);
  }

  EXPECT_FALSE(asked_to_stop);
  const auto stopped = client.request("motion", "", lifecycle::TRANSITION_STOP_PROCESS, patience);
  ASSERT_TRUE(stopped.has_value());
  EXPECT_TRUE(asked_to_stop);

  ASSERT_TRUE(eventually([&] {
    for (const auto& notice : client.take_notices())
      if (std::string{notice.text().c_str()}.find("inactive -> active") != std::string::npos) return true;
    return false;
  }));
}

/// Takes three milliseconds a step, on a sample that nobody renews.
struct Slow final : Component {
  Input<stage::AxisState> state{*this, "state"};
  void step(const Tick&) noexcept override {
    const Instant end = monotonic_now() + Duration::milliseconds(3);
    while (monotonic_now() < end) {
    }
  }
};

class LateService : public ::testing::TestWithParam<LatePolicy> {};

TEST_P(LateService, SaysWhatLatencyIsNotKeptInItsStatusAndByNoticesAsDeclared) {
  ExecutorOptions options;
  options.process = "motion";
  options.period = Duration::milliseconds(20);
  options.late = GetParam();
  options.real_time = RealTimeRequest{};
  options.real_time->latency = Duration::milliseconds(2);
  Executor executor{options};
  auto owned = std::make_unique<Slow>();
  Slow& slow = *owned;
  slow.name = "slow";
  slow.id = 1;
  executor.add(std::move(owned), {.type = "slow",
                                  .parameters = {},
                                  .storage = nullptr,
                                  .every = 1,
                                  .latencies = {{"state", Duration::seconds(10.0)}}});
  executor.start();
  ProcessControl control{executor};
  stage::AxisState old;
  old.at().time_ns((utc_now() - Duration::seconds(60.0)).ns);
  slow.state.accept(old, utc_now());
  Node node{local("motion"), standard_profiles()};
  ProcessService::Options service_options;
  service_options.cell = 1;
  service_options.interval = Duration::milliseconds(50);
  ProcessService service{node, control, service_options};
  service.start();
  Node tool{local("tool"), standard_profiles()};
  CellClient client{tool};
  EXPECT_TRUE(control.request("", Transition::configure).ok());
  EXPECT_TRUE(control.request("", Transition::activate).ok());

  ASSERT_TRUE(eventually([&] {
    return client.processes().size() == 1 && client.processes()[0].late() > 0 &&
           client.components().size() == 1 && client.components()[0].inputs().size() == 1 &&
           client.components()[0].inputs()[0].late() > 0;
  }));
  const auto process = client.processes()[0];
  EXPECT_EQ(process.latency_limit_ns(), 2'000'000);
  EXPECT_GE(process.latency().max_ns(), 3'000'000);
  const auto input = client.components()[0].inputs()[0];
  EXPECT_STREQ(input.port().c_str(), "state");
  EXPECT_EQ(input.limit_ns(), 10'000'000'000);
  EXPECT_GE(input.age().max_ns(), 60'000'000'000);

  bool cycle = false;
  bool sample = false;
  bool activated = false;
  const auto look = [&] {
    for (const auto& notice : client.take_notices()) {
      const std::string text = notice.text().c_str();
      cycle = cycle || text.find("cycles ended later than the declared latency of 2 ms") != std::string::npos;
      sample = sample ||
               text.find("read a sample of `state` older than the declared latency") != std::string::npos;
      activated = activated || text.find("inactive -> active") != std::string::npos;
    }
  };
  if (GetParam() == LatePolicy::event) {
    EXPECT_TRUE(eventually([&] { return look(), cycle && sample; }));
  } else {
    const auto late =
        process.late();  // two more looks of the service, and the notices that it did write have come
    EXPECT_TRUE(eventually([&] { return look(), activated && client.processes()[0].late() > late + 10; }));
    EXPECT_FALSE(cycle || sample);
  }
  executor.stop();
}

INSTANTIATE_TEST_SUITE_P(Policies, LateService, ::testing::Values(LatePolicy::event, LatePolicy::mark),
                         [](const auto& policy) {
                           return policy.param == LatePolicy::event ? "Event" : "Mark";
                         });

TEST(CellClient, NobodyAnswersForAnAbsentProcess) {
  Node tool{local("tool"), standard_profiles()};
  CellClient client{tool};
  EXPECT_FALSE(
      client.request("absent", "", lifecycle::TRANSITION_CONFIGURE, Duration::milliseconds(300)).has_value());
}

TEST(WireTransition, HasTheWordsOfTheCommandLine) {
  EXPECT_EQ(parse_wire_transition("activate"), lifecycle::TRANSITION_ACTIVATE);
  EXPECT_EQ(parse_wire_transition("stop"), lifecycle::TRANSITION_STOP_PROCESS);
  EXPECT_FALSE(parse_wire_transition("go").has_value());
}

}  // namespace
}  // namespace invar::dds
