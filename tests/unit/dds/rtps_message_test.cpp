// What the filter lets through and what it drops, message by message.
#include "core/dds/rtps_message.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <string>

#include "core/base/clock.hpp"
#include "core/dds/sequence_guard.hpp"
#include "tests/support/rtps_builder.hpp"

namespace invar::dds {
namespace {

using Build = invar::testing::RtpsBuilder;
using Fragment = Build::Fragment;

constexpr std::uint32_t user_writer = 0x00000103;

struct Case {
  const char* name;
  Flaw flaw;
  std::vector<std::byte> message;
};

std::vector<std::uint8_t> text(const std::string& characters, std::uint32_t length) {
  std::vector<std::uint8_t> out((4 + characters.size() + 3) / 4 * 4);
  for (unsigned i = 0; i < 4; ++i) out[i] = static_cast<std::uint8_t>(length >> 8U * i);
  for (std::size_t i = 0; i < characters.size(); ++i) out[4 + i] = static_cast<std::uint8_t>(characters[i]);
  return out;
}

/// Sound discovery of an endpoint with one more parameter.
Build endpoint(std::uint16_t id, const std::vector<std::uint8_t>& value) {
  Build b;
  b.discovery(publication_writer).guid(0x5a).parameter(id, value).sentinel();
  return b;
}

std::vector<std::uint8_t> locator(std::uint8_t kind, std::uint32_t port) {
  std::vector<std::uint8_t> out(24);
  out[0] = kind;
  out[4] = static_cast<std::uint8_t>(port);
  out[5] = static_cast<std::uint8_t>(port >> 8U);
  return out;
}

// The 84 octets: header, statistics of Fast DDS, and a PAD behind them.
std::vector<std::byte> statistics_in_the_middle() { return Build{}.begin(0x80).fill(56).begin(0x01).bytes(); }

std::vector<Case> cases() {
  constexpr auto four = std::uint8_t{4};
  const auto bad = [](const char* name, Flaw flaw, Build build) { return Case{name, flaw, build.bytes()}; };
  return {
      // sound ones
      bad("header_alone", Flaw::none, Build{}),
      bad("statistics_at_the_end", Flaw::none, Build{}.heartbeat(1, 0).begin(0x80).fill(56)),
      bad("data", Flaw::none, Build{}.data(5, user_writer, 1).fill(8)),
      bad("data_of_the_fiftieth_day", Flaw::none, Build{}.data(5, user_writer, 5'000'000'000).fill(8)),
      bad("data_with_inline_qos", Flaw::none,
          Build{}.data(7, user_writer, 1).parameter(0x70, std::vector<std::uint8_t>(16)).sentinel().fill(8)),
      bad("fragments", Flaw::none,
          Build{}.fragment({1, 2, 1000, 5000, 2000}).fragment({5, 1, 1000, 4500, 500})),
      bad("gap", Flaw::none, Build{}.begin(0x08).entity(0).entity(user_writer).number(1).number(40).u32(0)),
      bad("first_acknack", Flaw::none, Build{}.begin(0x06).fill(8).number(0).u32(0).u32(1)),
      bad("nack_of_a_fragment", Flaw::none,
          Build{}.begin(0x12).fill(8).number(1).u32(2).u32(1).u32(1U << 31U).u32(1)),
      bad("participant", Flaw::none,
          Build{}.discovery(participant_writer).guid(0x50).parameter(2, {5, 0, 0, 0, 0, 0, 0, 0}).sentinel()),
      bad("endpoint_that_ends", Flaw::none,
          Build{}.data(3, publication_writer, 2).parameter(0x71, {0, 0, 0, 3}).sentinel()),
      bad("unknown_parameter", Flaw::none, endpoint(0x8123, {1, 2, 3, 4})),
      // header and submessages
      Case{"empty", Flaw::header, {}},
      bad("other_name", Flaw::header,
          [] {
            Build b;
            return b;
          }()
              .begin(0x01)),
      Case{"statistics_in_the_middle", Flaw::kind, statistics_in_the_middle()},
      bad("statistics_of_another_size", Flaw::kind, Build{}.begin(0x80).fill(52)),
      bad("statistics_of_another_vendor", Flaw::kind, Build{0x0110}.begin(0x80).fill(56)),
      bad("secured", Flaw::kind, Build{}.begin(0x31).fill(20)),
      bad("longer_than_the_message", Flaw::length, Build{}.u8(0x07).u8(1).u16(29).fill(28)),
      bad("half_a_head", Flaw::length, Build{}.u16(0)),
      bad("short_heartbeat", Flaw::length, Build{}.begin(0x07).fill(24)),
      bad("short_destination", Flaw::length, Build{}.begin(0x0e).fill(8)),
      bad("short_data", Flaw::length, Build{}.begin(0x15, 5).u16(0).u16(16).fill(12)),
      bad("inline_qos_before_the_data", Flaw::length,
          Build{}.begin(0x15, 5).u16(0).u16(0xfff0).fill(8).number(1).fill(8)),
      bad("reply_to_endless_locators", Flaw::length, Build{}.begin(0x0f).u32(0x10000000).fill(24)),
      // numbers
      bad("data_number_0", Flaw::numbers, Build{}.data(5, user_writer, 0).fill(8)),
      bad("data_number_negative", Flaw::numbers, Build{}.data(5, user_writer, -1).fill(8)),
      bad("heartbeat_backwards", Flaw::numbers, Build{}.heartbeat(9, 7)),
      bad("acknack_negative", Flaw::numbers, Build{}.begin(0x06).fill(8).number(-1).u32(0).u32(1)),
      bad("acknack_of_too_many_bits", Flaw::length,
          Build{}.begin(0x06).fill(8).number(1).u32(257).fill(36).u32(1)),
      bad("gap_without_its_bits", Flaw::length,
          Build{}.begin(0x08).entity(0).entity(user_writer).number(1).number(2).u32(64).u32(0)),
      bad("gap_backwards", Flaw::numbers, Build{}.begin(0x08).fill(8).number(9).number(3).u32(0)),
      bad("nack_of_fragment_0", Flaw::numbers,
          Build{}.begin(0x12).fill(8).number(1).u32(0).u32(1).u32(1U << 31U).u32(1)),
      bad("nack_of_no_fragment", Flaw::numbers, Build{}.begin(0x12).fill(8).number(1).u32(1).u32(0).u32(1)),
      bad("nack_of_a_fragment_beyond_any", Flaw::numbers,
          Build{}.begin(0x12).fill(8).number(1).u32(0x7fffffff).u32(1).u32(1U << 31U).u32(1)),
      // fragments
      bad("fragment_0", Flaw::fragment, Build{}.fragment({0})),
      bad("no_fragment", Flaw::fragment, Build{}.fragment({1, 0})),
      bad("fragment_size_0", Flaw::fragment, Build{}.fragment({1, 1, 0})),
      bad("fragment_size_1", Flaw::fragment, Build{}.fragment({1, 1, 1, 5000, 1000})),
      bad("fragment_beyond_the_sample", Flaw::fragment, Build{}.fragment({6})),
      bad("fragment_of_4_GB", Flaw::fragment, Build{}.fragment({1, 1, 1000, 0xfffffff0U})),
      bad("fragment_without_its_payload", Flaw::fragment, Build{}.fragment({1, 5, 1000, 5000, 1000})),
      bad("fragment_of_a_key", Flaw::fragment, Build{}.fragment({}, 5)),
      bad("fragment_of_discovery", Flaw::fragment,
          Build{}.fragment({1, 1, 1000, 5000, 1000, 1, participant_writer})),
      // payloads and lists
      bad("data_and_key", Flaw::payload, Build{}.data(13, user_writer, 1).fill(8)),
      bad("data_of_two_octets", Flaw::payload, Build{}.data(5, user_writer, 1).fill(2)),
      bad("liveliness_of_four_octets", Flaw::payload,
          Build{}.data(5, participant_message_writer, 1).fill(four)),
      bad("inline_qos_without_end", Flaw::parameters,
          Build{}.data(7, user_writer, 1).parameter(0x70, std::vector<std::uint8_t>(16))),
      bad("inline_qos_longer_than_the_rest", Flaw::parameters,
          Build{}.data(7, user_writer, 1).u16(0x70).u16(0xfffc).fill(16)),
      bad("short_key_hash", Flaw::parameters,
          Build{}.data(7, user_writer, 1).parameter(0x70, {1, 2, 3, 4}).sentinel().fill(8)),
      // discovery
      bad("discovery_without_data", Flaw::discovery, Build{}.data(1, publication_writer, 1)),
      bad("discovery_without_name", Flaw::discovery, Build{}.discovery(publication_writer).sentinel()),
      bad("discovery_without_end", Flaw::discovery, Build{}.discovery(publication_writer).guid(0x5a)),
      bad("discovery_in_cdr", Flaw::discovery,
          Build{}.data(5, publication_writer, 1).u16(0x0100).u16(0).guid(0x5a).sentinel()),
      bad("discovery_of_somebody_else", Flaw::discovery,
          Build{}.discovery(participant_writer).guid(0x50, 9).sentinel()),
      bad("short_guid", Flaw::discovery,
          Build{}.discovery(participant_writer).parameter(0x50, {1, 2, 3, 4}).sentinel()),
      bad("name_without_zero", Flaw::discovery, endpoint(0x05, text("abcd", 4))),
      bad("name_longer_than_its_parameter", Flaw::discovery, endpoint(0x05, text("abc", 400))),
      bad("name_of_no_length", Flaw::discovery, endpoint(0x05, text("abc", 0))),
      bad("name_of_300_characters", Flaw::discovery, endpoint(0x07, text(std::string(300, 'x'), 301))),
      bad("odd_parameter", Flaw::discovery, endpoint(0x05, {1, 0, 0, 0, 0})),
      bad("endless_partitions", Flaw::discovery,
          endpoint(0x29, {0xff, 0xff, 0xff, 0x7f, 1, 0, 0, 0, 0, 0, 0, 0})),
      bad("endless_properties", Flaw::discovery,
          endpoint(0x59, {0xff, 0xff, 0xff, 0x7f, 1, 0, 0, 0, 0, 0, 0, 0})),
      bad("endless_data_sharing", Flaw::discovery,
          endpoint(0x8006, {0xff, 0xff, 0xff, 0x7f, 0, 0, 0, 0, 0, 0, 0, 0})),
      bad("endless_representations", Flaw::discovery, endpoint(0x73, {0xff, 0xff, 0xff, 0x7f, 0, 0, 0, 0})),
      bad("user_data_longer_than_its_parameter", Flaw::discovery, endpoint(0x2c, {9, 0, 0, 0, 1, 2, 3, 4})),
      bad("unknown_durability", Flaw::discovery, endpoint(0x1d, {7, 0, 0, 0})),
      bad("boolean_of_7", Flaw::discovery, endpoint(0x43, {7, 0, 0, 0})),
      bad("no_lease", Flaw::discovery, endpoint(0x02, std::vector<std::uint8_t>(8))),
      bad("short_locator", Flaw::discovery, endpoint(0x2f, {1, 0, 0, 0})),
      bad("shared_memory_of_another_domain", Flaw::discovery, endpoint(0x2f, locator(16, 60'000))),
  };
}

class Message : public ::testing::TestWithParam<Case> {};

TEST_P(Message, IsLetThroughOrDroppedForItsCause) {
  const RtpsLimits limits{8U << 20U, 7400, 7649};
  SequenceGuard guard;
  RtpsContent content;
  auto message = GetParam().message;
  if (std::string{GetParam().name} == "other_name") message[0] = std::byte{'X'};
  EXPECT_EQ(flaw_text(examine(message, limits, guard, content)), flaw_text(GetParam().flaw));
}

INSTANTIATE_TEST_SUITE_P(Rtps, Message, ::testing::ValuesIn(cases()),
                         [](const auto& one) { return std::string{one.param.name}; });

TEST(RtpsMessage, ThatKillsTheLibraryHas84Octets) { EXPECT_EQ(statistics_in_the_middle().size(), 84U); }

TEST(RtpsMessage, IsHandedOnWithoutTheStatisticsAtItsEnd) {
  SequenceGuard guard;
  RtpsContent content;
  const auto message = Build{}.heartbeat(1, 0).begin(0x80).fill(56).bytes();
  ASSERT_EQ(examine(message, {}, guard, content), Flaw::none);
  EXPECT_EQ(content.size, message.size() - 60);
}

TEST(RtpsMessage, NamesTheParametersThatTheLibraryMustNotRead) {
  SequenceGuard guard;
  RtpsContent content;
  auto build = endpoint(0x75, {1, 2, 3, 4});
  const auto message = build.bytes();
  ASSERT_EQ(examine(message, {}, guard, content), Flaw::none);
  ASSERT_EQ(content.hidden_count, 1U);
  EXPECT_EQ(message[content.hidden[0]], std::byte{0x75});
}

Build& secure_prefix(Build& build) { return build.begin(0x31).fill(20); }
/// `size`: of the encrypted octets, as the body says; four are there.
Build& secure_body(Build& build, std::uint8_t size = 4) { return build.begin(0x30).fill(3).u8(size).fill(4); }
/// `tags`: of single receivers, as the postfix says; none is there.
Build& secure_postfix(Build& build, std::uint8_t tags = 0) {
  return build.begin(0x32).fill(16).fill(3).u8(tags);
}

Flaw flaw_of(Build& build, bool secured) {
  SequenceGuard guard;
  RtpsContent content;
  return examine(build.bytes(), {8U << 20U, 7400, 7649, secured}, guard, content);
}

TEST(SecuredMessage, IsReadInASecuredCellAlone) {
  Build whole, prefix_of_wrong_size, plain;
  secure_postfix(secure_body(secure_prefix(whole)));
  EXPECT_EQ(flaw_text(flaw_of(whole, true)), flaw_text(Flaw::none));
  EXPECT_EQ(flaw_text(flaw_of(whole, false)), flaw_text(Flaw::kind));
  secure_postfix(secure_body(prefix_of_wrong_size.begin(0x31).fill(16)));
  EXPECT_EQ(flaw_text(flaw_of(prefix_of_wrong_size, true)), flaw_text(Flaw::length));
  secure_postfix(secure_prefix(plain).heartbeat(1, 0));  // signed alone
  EXPECT_EQ(flaw_text(flaw_of(plain, true)), flaw_text(Flaw::none));
}

TEST(SecuredMessage, SaysNoMoreThanItHas) {
  Build body, tags;
  secure_postfix(
      secure_body(secure_prefix(body), 200));  // Fast DDS 2.9 would decrypt what lies behind the message
  EXPECT_EQ(flaw_text(flaw_of(body, true)), flaw_text(Flaw::length));
  secure_postfix(secure_body(secure_prefix(tags)), 9);
  EXPECT_EQ(flaw_text(flaw_of(tags, true)), flaw_text(Flaw::length));
}

TEST(SecuredMessage, HasOneSubmessageBetweenPrefixAndPostfix) {
  Build two, none, open, twice, loose;
  secure_postfix(secure_prefix(two).heartbeat(1, 0).heartbeat(1, 0));
  secure_postfix(secure_prefix(none));
  secure_body(secure_prefix(open));
  secure_postfix(secure_body(secure_prefix(secure_prefix(twice))));
  secure_body(loose);
  for (Build* broken : {&two, &none, &open, &twice, &loose})
    EXPECT_EQ(flaw_text(flaw_of(*broken, true)), flaw_text(Flaw::kind));
}

GuidPrefix known_prefix() {
  GuidPrefix prefix;
  prefix.fill(std::byte{Build::prefix_octet});
  return prefix;
}

// The library walks from the old number to the new one, one by one, and holds its lock: 2^40 of them take hours.
TEST(SequenceGuard, LetsNoHeartbeatLeapFarBeyondTheLastNumber) {
  SequenceGuard guard;
  RtpsContent content;
  guard.know(known_prefix(), user_writer);
  EXPECT_EQ(examine(Build{}.heartbeat(1, 1000).bytes(), {}, guard, content), Flaw::none);
  EXPECT_EQ(examine(Build{}.heartbeat(1, 50'000).bytes(), {}, guard, content), Flaw::none);
  EXPECT_EQ(examine(Build{}.heartbeat(1LL << 40, (1LL << 40) + 7).bytes(), {}, guard, content), Flaw::jump);
  EXPECT_EQ(
      examine(Build{}.begin(0x08).entity(0).entity(user_writer).number(3).number(1LL << 39).u32(0).bytes(),
              {}, guard, content),
      Flaw::jump);
  EXPECT_EQ(examine(Build{}.data(5, user_writer, 1LL << 38).fill(8).bytes(), {}, guard, content), Flaw::jump);
  EXPECT_EQ(examine(Build{}.data(5, user_writer, 50'001).fill(8).bytes(), {}, guard, content), Flaw::none);
}

TEST(SequenceGuard, LetsAWriterGoOnAfterAnHourWithoutNetwork) {
  SequenceGuard guard;
  const GuidPrefix prefix = known_prefix();
  guard.know(prefix, user_writer);
  const Instant now = monotonic_now();
  using Step = SequenceGuard::Step;
  EXPECT_TRUE(guard.admits(prefix, user_writer, 1000, Step::filed, now));
  EXPECT_FALSE(guard.admits(prefix, user_writer, 3'601'000, Step::filed, now));
  EXPECT_TRUE(guard.admits(prefix, user_writer, 3'601'000, Step::filed, now + Duration::seconds(3600)));
  guard.forget(prefix);
  EXPECT_TRUE(guard.admits(prefix, user_writer, 1LL << 40, Step::filed, now))
      << "nobody listens to a stranger";
}

TEST(SequenceGuard, KnowsHowManyFragmentsWereSent) {
  SequenceGuard guard;
  guard.sent(user_writer, 5, 12);
  EXPECT_TRUE(guard.has_fragment(user_writer, 5, 12));
  EXPECT_FALSE(guard.has_fragment(user_writer, 5, 13));
  EXPECT_TRUE(guard.has_fragment(user_writer, 6, 13));
}

}  // namespace
}  // namespace invar::dds
