#include "core/dds/node.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <mutex>

#include "core/base/fault.hpp"
#include "domain.hpp"
#include "idl/types.hpp"

namespace invar::dds {
namespace {

using testing::eventually;
using ::testing::HasSubstr;
using testing::local;

struct Source final : Component {
  Output<stage::AxisState> state{*this, "state"};
  Output<stage::AxisCommand> command{*this, "command", "command"};
  void step(const Tick&) noexcept override {}
};

struct Destination final : Component {
  Input<stage::AxisState> state{*this, "state"};
  Inbox<stage::AxisCommand> command{*this, "command"};
  void step(const Tick&) noexcept override {}
};

void name_topics(Component& component) {
  for (Port* port : component.ports()) port->topic = topic_name("test", "axis", port->name());
}

stage::AxisCommand command(std::uint64_t id) {
  stage::AxisCommand sample;
  sample.id(id);
  return sample;
}

class Pair : public ::testing::TestWithParam<bool> {
 protected:
  Pair() {
    name_topics(source);
    name_topics(destination);
  }
  NodeOptions options(const std::string& name) const {
    NodeOptions o = local(name);
    o.shared_memory = GetParam();
    return o;
  }
  Source source;
  Destination destination;
};

TEST_P(Pair, SamplesGoFromPortToPortAcrossParticipants) {
  Node writing{options("writing"), standard_profiles()};
  Node reading{options("reading"), standard_profiles()};
  const OutputBinding paced{Duration::milliseconds(1), {}};
  writing.bind(source.state, paced);
  writing.bind(source.command, paced);
  reading.bind(destination.state);
  reading.bind(destination.command);
  writing.start();
  std::uint64_t cycle = 0;
  ASSERT_TRUE(eventually([&] {
    stage::AxisState state;
    state.axis(2);
    state.at().cycle(++cycle);
    state.position(1e-3 * static_cast<double>(cycle));
    state.mode(stage::AXIS_MODE_MOVING);
    source.set_now(utc_now());
    source.state.write(state);
    return destination.state.latest() != nullptr;
  }));
  const stage::AxisState* state = destination.state.latest();
  EXPECT_EQ(state->axis(), 2U);
  EXPECT_DOUBLE_EQ(state->position(), 1e-3 * static_cast<double>(state->at().cycle()));
  EXPECT_GT(destination.state.arrived().ns, 0);

  // Commands written after both ends know each other arrive all, in order.
  ASSERT_TRUE(eventually([&] {
    source.command.write(command(0));
    stage::AxisCommand taken;
    return destination.command.take(taken);
  }));
  for (std::uint64_t id = 1; id <= 50; ++id) source.command.write(command(id));
  std::uint64_t expected = 1;
  ASSERT_TRUE(eventually([&] {
    for (stage::AxisCommand taken; destination.command.take(taken);) {
      if (taken.id() == 0) continue;  // further tries of before
      EXPECT_EQ(taken.id(), expected++);
    }
    return expected == 51;
  }));
  writing.stop();
  reading.stop();
  EXPECT_EQ(writing.lost(), 0U);
}

TEST_P(Pair, WhatAWriterForgetsNoLateReaderGets) {
  Node writing{options("writing"), standard_profiles()};
  Node reading{options("reading"), standard_profiles()};
  auto writer = writing.writer<stage::AxisState>("test/kept", writing.profile("state"));
  const auto write = [&](std::uint32_t axis) {
    stage::AxisState state;
    state.axis(axis);
    EXPECT_TRUE(writer.write(state));
  };
  write(1);
  writer.connection().forget();
  write(2);
  std::mutex mutex;
  std::vector<std::uint32_t> got;
  const auto reader = reading.reader<stage::AxisState>("test/kept", reading.profile("state"),
                                                       [&](const stage::AxisState& state) {
                                                         const std::lock_guard lock{mutex};
                                                         got.push_back(state.axis());
                                                       });
  EXPECT_TRUE(eventually([&] {
    const std::lock_guard lock{mutex};
    return !got.empty();
  }));
  EXPECT_TRUE(writer.connection().wait_for_acknowledgments(Duration::milliseconds(2000)));
  const std::lock_guard lock{mutex};
  EXPECT_EQ(got, std::vector<std::uint32_t>{2});
}

INSTANTIATE_TEST_SUITE_P(Transports, Pair, ::testing::Bool(),
                         [](const auto& kind) { return kind.param ? "SharedMemoryAndUdp" : "UdpOnly"; });

TEST(Node, ALateReaderOfStateGetsTheLatestOfEachInstance) {
  Node writing{local("writing"), standard_profiles()};
  auto writer = writing.writer<thermal::NodeTemperature>("cell/test/heat", "state");
  for (std::uint32_t node = 1; node <= 3; ++node)
    for (int i = 0; i < 5; ++i) {
      thermal::NodeTemperature sample;
      sample.node(node);
      sample.temperature(20.0 + i);
      ASSERT_TRUE(writer.write(sample));
    }
  Node reading{local("reading"), standard_profiles()};
  std::mutex mutex;
  std::map<std::uint32_t, std::vector<double>> got;
  const auto reader =
      reading.reader<thermal::NodeTemperature>("cell/test/heat", "state", [&](const auto& sample) {
        const std::lock_guard lock{mutex};
        got[sample.node()].push_back(sample.temperature());
      });
  ASSERT_TRUE(eventually([&] {
    const std::lock_guard lock{mutex};
    return got.size() == 3;
  }));
  const std::lock_guard lock{mutex};
  for (const auto& [node, values] : got) EXPECT_THAT(values, ::testing::ElementsAre(24.0)) << node;
}

TEST(Node, AMismatchRaisesAnAlarmThatNamesBothEndsAndThePolicy) {
  Node writing{local("hasty"), standard_profiles()};
  Node reading{local("careful"), standard_profiles()};
  const auto writer = writing.writer<stage::AxisState>("cell/test/x", "realtime");
  const auto reader = reading.reader<stage::AxisState>("cell/test/x", "event", [](const auto&) {});
  std::string text;
  ASSERT_TRUE(eventually([&] {
    for (const auto& alarm : reading.take_alarms()) text += alarm.text + "\n";
    return !text.empty();
  }));
  EXPECT_THAT(text, HasSubstr("invar/test/hasty/realtime"));
  EXPECT_THAT(text, HasSubstr("invar/test/careful"));
  EXPECT_THAT(text, HasSubstr("reliability: writer offers best_effort, reader asks for reliable"));
  EXPECT_THAT(text, HasSubstr("durability"));
  EXPECT_EQ(reader->matched(), 0U);
}

TEST(Node, RawReaderSeesTheBytesTheSequenceAndTheWriter) {
  Node node{local("node"), standard_profiles()};
  auto writer = node.writer<event::Notice>("cell/test/events", "event");
  Node tool{local("tool"), standard_profiles()};
  std::mutex mutex;
  std::vector<std::pair<std::uint64_t, std::size_t>> got;
  const auto raw = tool.raw_reader("cell/test/events", "invar::event::Notice",
                                   standard_profiles().at("event"), [&](const RawSample& sample) {
                                     const std::lock_guard lock{mutex};
                                     EXPECT_EQ(sample.cdr[1], std::byte{1});  // little-endian CDR
                                     EXPECT_FALSE(sample.writer.empty());
                                     got.emplace_back(sample.sequence, sample.cdr.size());
                                   });
  event::Notice notice;
  for (int i = 0; i < 20; ++i) {
    notice.code(static_cast<std::uint32_t>(i));
    notice.component_id(static_cast<std::uint32_t>(i % 3));
    notice.text("something");
    ASSERT_TRUE(writer.write(notice));
  }
  ASSERT_TRUE(eventually([&] {
    const std::lock_guard lock{mutex};
    return got.size() == 20;
  }));
  std::sort(got.begin(), got.end());  // DDS keeps the order of each instance only
  for (std::size_t i = 0; i < 20; ++i) EXPECT_EQ(got[i].first, i + 1);
  EXPECT_EQ(got[0].second,
            (4 + event::Notice::getCdrSerializedSize(notice) + 3) / 4 * 4);  // RTPS pads to words
}

TEST(Node, RawWriterIsReadByATypedReader) {
  Node tool{local("tool"), standard_profiles()};
  Node node{local("node"), standard_profiles()};
  std::atomic<std::uint32_t> axis{0};
  const auto reader =
      node.reader<stage::AxisCommand>("cell/test/c", "command", [&](const auto& c) { axis = c.axis(); });
  const auto raw =
      tool.raw_writer("cell/test/c", "invar::stage::AxisCommand", standard_profiles().at("command"));
  stage::AxisCommand sample;
  sample.axis(7);
  eprosima::fastrtps::rtps::SerializedPayload_t payload{1000};
  stage::AxisCommandPubSubType type;
  ASSERT_TRUE(type.serialize(&sample, &payload));
  const std::span<const std::byte> bytes{reinterpret_cast<const std::byte*>(payload.data), payload.length};
  ASSERT_TRUE(eventually([&] { return raw->write(&bytes), axis == 7; }));
}

TEST(Node, SnapshotShowsTopicsTypesAndWhoseTheyAre) {
  Node node{local("motion"), standard_profiles()};
  const auto writer = node.writer<stage::AxisState>("cell/test/x", "realtime");
  Node tool{local("tool"), standard_profiles()};
  Endpoint found;
  ASSERT_TRUE(eventually([&] {
    for (const auto& endpoint : tool.snapshot().endpoints)
      if (endpoint.topic == "cell/test/x" && !endpoint.participant.starts_with("an ")) found = endpoint;
    return !found.id.empty();
  }));
  EXPECT_EQ(found.type, "invar::stage::AxisState");
  EXPECT_EQ(found.participant, "invar/test/motion/realtime");
  EXPECT_TRUE(found.is_writer);
  EXPECT_FALSE(found.qos.reliable);
  EXPECT_EQ(found.qos.deadline.ns, standard_profiles().at("realtime").deadline.ns);
}

TEST(Node, ATopicOfTwoTypesIsRefused) {
  Node node{local("node"), standard_profiles()};
  const auto writer = node.writer<stage::AxisState>("cell/test/x", "state");
  try {
    (void)node.writer<stage::AxisCommand>("cell/test/x", "state");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("is of type invar::stage::AxisState"));
  }
}

TEST(Node, AnOutputMayBeThinnedOnTheWire) {
  Source source;
  Destination destination;
  name_topics(source);
  name_topics(destination);
  source.state.profile = "event";
  Node writing{local("writing"), standard_profiles()};
  std::mutex mutex;
  std::vector<std::uint64_t> cycles;
  Node reading{local("reading"), standard_profiles()};
  const auto reader = reading.reader<stage::AxisState>(source.state.topic, "event", [&](const auto& s) {
    const std::lock_guard lock{mutex};
    cycles.push_back(s.at().cycle());
  });
  writing.bind(source.state, {{}, Duration::milliseconds(10)});
  for (std::uint64_t cycle = 0; cycle < 100; ++cycle) {
    source.set_now({static_cast<std::int64_t>(cycle) * 1'000'000});
    stage::AxisState state;
    state.at().cycle(cycle);
    source.state.write(state);
  }
  ASSERT_TRUE(eventually([&] {
    const std::lock_guard lock{mutex};
    return cycles.size() >= 10;
  }));
  EXPECT_THAT(cycles, ::testing::ElementsAre(0, 10, 20, 30, 40, 50, 60, 70, 80, 90));
}

}  // namespace
}  // namespace invar::dds
