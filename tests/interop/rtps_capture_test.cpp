// What Fast DDS and Cyclone DDS really send, with losses: all of it passes the filter. Left behind as a corpus for the fuzz.
#include <gmock/gmock.h>

#include <fstream>
#include <set>

#include "core/dds/node.hpp"
#include "core/dds/rtps_message.hpp"
#include "core/dds/rtps_submessage.hpp"
#include "core/dds/sequence_guard.hpp"
#include "idl/types.hpp"
#include "tests/interop/process.hpp"
#include "tests/support/rtps_mutator.hpp"
#include "tests/support/rtps_tap.hpp"
#include "tests/unit/dds/domain.hpp"

namespace invar::dds {
namespace {

using testing::eventually;
using ::testing::IsSupersetOf;

const std::string loopback =
    "CYCLONEDDS_URI=<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\" "
    "multicast=\"true\"/>"
    "</Interfaces></General></Domain></CycloneDDS>";

std::set<int> kinds(const std::vector<std::byte>& message) {
  std::set<int> out;
  std::size_t at = rtps_header_size;
  while (const auto sub = submessage_at(message, at)) {
    out.insert(sub->id);
    at = sub->end;
  }
  return out;
}

TEST(RtpsCapture, EverythingThatFastDdsAndCycloneDdsSendPassesTheFilter) {
  NodeOptions options = testing::local("motion");
  options.shared_memory = false;
  Node node{options, standard_profiles()};
  auto states = node.writer<stage::AxisState>("cell/test/axis/state", "realtime");
  auto heat = node.writer<thermal::NodeTemperature>("cell/test/heat/node", "state");
  auto frames = node.writer<image::Frame>("cell/test/camera/frame", "calibration");
  auto component = node.writer<lifecycle::ComponentStatus>("cell/test/process/components", "state");
  const auto commands =
      node.reader<stage::AxisCommand>("cell/test/axis/command", "command", [](const auto&) {});
  // One in ten lost and messages of 1400 octets: so everything is asked for again, fragments too.
  invar::testing::RtpsTap tap{options.domain, "127.0.0.1", 10, 1400};
  invar::testing::Child peer{{INVAR_CYCLONE_PEER, std::to_string(options.domain), "40"}, {loopback}};
  stage::AxisState state;
  thermal::NodeTemperature temperature;
  image::Frame frame;
  frame.pixels().resize(300'000);
  component.write(lifecycle::ComponentStatus{});
  int round = 0;
  const std::set<int> wanted{0x06, 0x07, 0x08, 0x09, 0x0e, 0x12, 0x15, 0x16};
  std::set<int> seen;
  EXPECT_TRUE(eventually([&] {
    state.axis(static_cast<std::uint32_t>(round % 2));
    states.write(state);
    temperature.node(round % 50 == 0 ? 1 : 2);  // the old sample of the one leaves a hole: a gap
    heat.write(temperature);
    if (++round % 20 == 0) {
      frame.number(static_cast<std::uint64_t>(round));
      frames.write(frame);
      tap.join();
    }
    (void)peer.output();
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
    if (round % 40 == 0)
      for (const auto& message : tap.messages()) seen.merge(kinds(message));
    return peer.has_ended() && round > 400 &&
           std::includes(seen.begin(), seen.end(), wanted.begin(), wanted.end());
  }));
  EXPECT_THAT(seen, IsSupersetOf(wanted));
  const auto messages = tap.messages();
  SequenceGuard guard;
  std::set<int> vendors;
  for (const auto& message : messages) {
    RtpsContent content;
    EXPECT_EQ(flaw_text(examine(message, {}, guard, content)), flaw_text(Flaw::none));
    constexpr std::size_t statistics = 60;
    EXPECT_TRUE(content.size == message.size() || content.size + statistics == message.size());
    vendors.insert(std::to_integer<int>(message[7]));
  }
  EXPECT_THAT(vendors, IsSupersetOf({0x0f, 0x10})) << "Fast DDS and Cyclone DDS";
  for (const auto& alarm : node.take_alarms())
    EXPECT_EQ(alarm.text.find("dropped"), std::string::npos) << alarm.text;
  invar::testing::write_corpus(INVAR_RTPS_CORPUS, messages);
}

}  // namespace
}  // namespace invar::dds
