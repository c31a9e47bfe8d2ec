// The defects of the generated type supports, mended: each test fails with the generated class itself.
#include "core/dds/type.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <cstring>
#include <thread>

#include "core/dds/node.hpp"
#include "domain.hpp"

namespace invar::dds {
namespace {

using testing::eventually;
using testing::local;

TEST(Type, KeysOfTwoThreadsDoNotMix) {
  Type<stage::AxisStatePubSubType> type;
  std::atomic<int> wrong{0};
  const auto work = [&](std::uint32_t axis) {
    stage::AxisState sample;
    sample.axis(axis);
    eprosima::fastrtps::rtps::InstanceHandle_t handle;
    for (int i = 0; i < 200'000; ++i) {
      type.getKey(&sample, &handle, false);
      if (handle.value[7] != static_cast<unsigned char>(axis)) ++wrong;  // big-endian: cell, axis
    }
  };
  std::thread other{work, 1};
  work(2);
  other.join();
  EXPECT_EQ(wrong, 0);
}

TEST(Type, IsNeverPlain) {
  const Type<stage::AxisStatePubSubType> type;
  EXPECT_FALSE(type.is_plain());
}

template <class B>
std::vector<std::byte> bytes_of(typename B::type& sample) {
  B type;
  eprosima::fastrtps::rtps::SerializedPayload_t payload{type.m_typeSize};
  EXPECT_TRUE(type.serialize(&sample, &payload));
  const auto* begin = reinterpret_cast<const std::byte*>(payload.data);
  return {begin, begin + payload.length};
}

TEST(Type, MalformedSamplesAreDroppedAndThoseBehindThemArrive) {
  Node node{local("node"), standard_profiles()};
  Node foreign{local("foreign"), standard_profiles()};
  std::atomic<int> good{0};
  const auto reader = node.reader<thermal::ThermalCommand>("cell/test/c", "event", [&](const auto& command) {
    EXPECT_EQ(command.id(), 7U);
    ++good;
  });
  const auto raw =
      foreign.raw_writer("cell/test/c", "invar::thermal::ThermalCommand", standard_profiles().at("event"));
  thermal::ThermalCommand sample;
  sample.id(7);
  const auto right = bytes_of<thermal::ThermalCommandPubSubType>(sample);
  auto poisoned = right;
  poisoned[poisoned.size() - 1] = std::byte{7};  // a boolean
  auto cut = right;
  cut.resize(12);
  const auto write = [&](const std::vector<std::byte>& bytes) {
    const std::span<const std::byte> span{bytes};
    return raw->write(&span);
  };
  ASSERT_TRUE(eventually([&] { return raw->matched() == 1; }));
  ASSERT_TRUE(eventually([&] { return write(right), good > 0; }));
  const int before = good;
  write(poisoned);
  write(cut);
  write(right);
  ASSERT_TRUE(eventually([&] { return good > before; }));
}

// Built with the IDL of before `recent_compute` was appended: the reader must not starve in silence.
TEST(Type, SamplesOfAnEarlierVersionAreRefusedInWordsThatNameTheirWriter) {
  Node node{local("reader"), standard_profiles()}, old{local("earlier"), standard_profiles()};
  std::atomic<int> good{0};
  const auto reader = node.reader<lifecycle::ComponentStatus>("cell/test/process/components", "state",
                                                              [&](const auto&) { ++good; });
  const auto raw = old.raw_writer("cell/test/process/components", "invar::lifecycle::ComponentStatus",
                                  standard_profiles().at("state"));
  lifecycle::ComponentStatus sample;
  auto bytes = bytes_of<lifecycle::ComponentStatusPubSubType>(sample);
  const auto write = [&] {
    const std::span<const std::byte> span{bytes};
    return raw->write(&span);
  };
  ASSERT_TRUE(eventually([&] { return raw->matched() == 1; }));
  ASSERT_TRUE(eventually([&] { return write(), good > 0; })) << "this version";
  bytes.resize(bytes.size() - sizeof(std::int64_t) * 4);
  std::string told;
  ASSERT_TRUE(eventually([&] {
    write();
    for (const auto& alarm : node.take_alarms()) told += alarm.topic + ": " + alarm.text + "\n";
    return !told.empty();
  }));
  EXPECT_THAT(told, ::testing::AllOf(::testing::HasSubstr("invar::lifecycle::ComponentStatus: "),
                                     ::testing::HasSubstr("samples of this type do not decode"),
                                     ::testing::HasSubstr("`invar/test/earlier`"),
                                     ::testing::HasSubstr("another version of the IDL")));
}

TEST(Type, BoundsAreEnforcedOnWhatArrives) {
  Type<stage::AxisCommandPubSubType> type;
  stage::AxisCommand sample;
  sample.kind(stage::AXIS_COMMAND_STOP);
  auto bytes = bytes_of<stage::AxisCommandPubSubType>(sample);
  const auto read = [&](std::vector<std::byte>& from) {
    eprosima::fastrtps::rtps::SerializedPayload_t payload;
    payload.data = reinterpret_cast<unsigned char*>(from.data());
    payload.length = payload.max_size = static_cast<std::uint32_t>(from.size());
    stage::AxisCommand out;
    const bool taken = type.deserialize(&payload, &out);
    payload.data = nullptr;
    return taken;
  };
  EXPECT_TRUE(read(bytes));
  bytes[4 + 32] = std::byte{99};  // kind, behind cell, axis, stamp and id
  EXPECT_FALSE(read(bytes));

  image::Frame frame;
  frame.pixels().resize(16);
  EXPECT_TRUE(idl::within_bounds(frame));
  frame.pixels().resize(2'097'153);
  EXPECT_FALSE(idl::within_bounds(frame));
}

}  // namespace
}  // namespace invar::dds
