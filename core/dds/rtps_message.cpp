#include "core/dds/rtps_message.hpp"

#include <algorithm>
#include <bitset>
#include <utility>

#include "core/base/clock.hpp"
#include "core/dds/rtps_bytes.hpp"
#include "core/dds/rtps_parameters.hpp"
#include "core/dds/rtps_submessage.hpp"
#include "core/dds/sequence_guard.hpp"

namespace invar::dds {

namespace {

constexpr std::size_t header_size = rtps_header_size;
constexpr std::uint16_t vendor_fast_dds = 0x010f;
/// No IPv4 network carries less in a datagram; smaller fragments would overlap in the library's list of missing ones.
constexpr std::uint16_t smallest_fragment = 64;
constexpr std::uint32_t most_bits = 256;  // of a set of numbers

bool is_of_discovery(std::uint32_t writer) {
  return writer == participant_writer || writer == publication_writer || writer == subscription_writer;
}

using Submessage = RtpsSubmessage;

struct Context {
  const RtpsLimits& limits;
  SequenceGuard& guard;
  RtpsContent& content;
  GuidPrefix source{};
  std::uint16_t vendor = 0;
  Instant now = monotonic_now();
  int behind_prefix = -1;  // submessages since a secure prefix; -1: there is none
};

bool is_number(std::int64_t number) { return number >= 1 && number <= SequenceGuard::last; }

/// Base, count and bits of a set of sequence or fragment numbers; the count of bits tells the size.
struct NumberSet {
  std::int64_t base = 0;
  std::uint32_t bits = 0;
  std::int64_t highest = 0;  // that is in the set; below the base where it is empty
};

Flaw read_set(RtpsBytes& bytes, NumberSet& set, bool of_fragments) {
  set.base = of_fragments ? bytes.u32() : bytes.sequence_number();
  set.bits = bytes.u32();
  if (!bytes.ok() || set.bits > most_bits) return Flaw::length;
  if (set.base < 0 || set.base > SequenceGuard::last) return Flaw::numbers;
  set.highest = set.base - 1;
  for (std::uint32_t bit = 0; bit < set.bits; bit += 32) {
    const std::uint32_t word = bytes.u32();
    for (std::uint32_t i = 0; i < 32 && word << i != 0; ++i)
      if ((word << i & 0x80000000U) != 0 && bit + i < set.bits) set.highest = set.base + bit + i;
  }
  return bytes.ok() ? Flaw::none : Flaw::length;
}

/// The head that DATA and DATA_FRAG share, up to the sequence number.
struct DataHead {
  std::size_t to_inline_qos = 0;
  std::uint32_t writer = 0;
  std::int64_t number = 0;
};

DataHead read_head(RtpsBytes& bytes) {
  DataHead head;
  bytes.skip(2);  // extra flags
  head.to_inline_qos = bytes.u16();
  bytes.skip(4);  // the reader
  head.writer = bytes.entity();
  head.number = bytes.sequence_number();
  return head;
}

/// Over what later versions may have put in between. Counted from behind the field that says so; the library takes it for a
/// signed number.
bool skip_to_inline_qos(RtpsBytes& bytes, const DataHead& head, std::size_t taken) {
  if (!bytes.ok() || head.to_inline_qos < taken || head.to_inline_qos > INT16_MAX) return false;
  bytes.skip(head.to_inline_qos - taken);
  return bytes.ok();
}

Flaw check_numbers(const DataHead& head, Context& context) {
  if (!is_number(head.number)) return Flaw::numbers;
  if (!context.guard.admits(context.source, head.writer, head.number, SequenceGuard::Step::filed,
                            context.now))
    return Flaw::jump;
  return Flaw::none;
}

/// The library takes the keys of what it hears from the payload, and keeps for good what it cannot read.
Flaw check_builtin(const DataHead& head, const Submessage& sub, const RtpsBytes& bytes, bool disposes,
                   Context& context) {
  constexpr std::size_t least_liveliness = 24;  // encapsulation, prefix, kind, length
  const bool has_data = sub.has(2);
  if (head.writer == participant_message_writer)
    return has_data && bytes.left() < least_liveliness ? Flaw::payload : Flaw::none;
  if (head.writer == stateless_writer && context.limits.secured)
    return has_data && is_sound_handshake(bytes.rest()) ? Flaw::none : Flaw::payload;
  if (!is_of_discovery(head.writer)) return Flaw::none;
  if (!has_data) return disposes ? Flaw::none : Flaw::discovery;
  const std::size_t offset = sub.offset + bytes.position();
  return is_sound_discovery(bytes.rest(), context.source, offset, context.limits, context.content)
             ? Flaw::none
             : Flaw::discovery;
}

Flaw check_data(const Submessage& sub, Context& context) {
  constexpr std::size_t before_inline_qos = 16;
  constexpr std::size_t encapsulation = 4;
  RtpsBytes bytes = sub.bytes();
  const DataHead head = read_head(bytes);
  if (!skip_to_inline_qos(bytes, head, before_inline_qos)) return Flaw::length;
  if (const Flaw flaw = check_numbers(head, context); flaw != Flaw::none) return flaw;
  InlineQos qos{true};
  if (sub.has(1)) qos = read_inline_qos(bytes, context.source, is_of_discovery(head.writer));
  if (!qos.sound) return Flaw::parameters;
  const bool has_data = sub.has(2);
  const bool has_key = sub.has(3);
  if (has_data && has_key) return Flaw::payload;
  if ((has_data || has_key) && bytes.left() < encapsulation) return Flaw::payload;
  return check_builtin(head, sub, bytes, qos.disposes, context);
}

Flaw check_data_frag(const Submessage& sub, Context& context) {
  constexpr std::size_t before_inline_qos = 28;
  RtpsBytes bytes = sub.bytes();
  const DataHead head = read_head(bytes);
  const std::uint64_t first = bytes.u32();
  const std::uint64_t count = bytes.u16();
  const std::uint64_t size = bytes.u16();
  const std::uint64_t sample = bytes.u32();
  if (!skip_to_inline_qos(bytes, head, before_inline_qos)) return Flaw::length;
  if (const Flaw flaw = check_numbers(head, context); flaw != Flaw::none) return flaw;
  // What discovery says is looked at whole, or not taken at all; and a key is too short to come in parts.
  if (is_of_discovery(head.writer) || head.writer == participant_message_writer || sub.has(2))
    return Flaw::fragment;
  if (size < smallest_fragment || sample <= size || sample > context.limits.largest_sample)
    return Flaw::fragment;
  const std::uint64_t fragments = (sample + size - 1) / size;
  if (first < 1 || count < 1 || first + count - 1 > fragments) return Flaw::fragment;
  // The library writes a number of four bytes, on a boundary of four, into the place of each missing fragment.
  const std::uint64_t last_size = sample - (fragments - 1) * size;
  if (size % 4 != 0 && last_size < 8) return Flaw::fragment;
  if (sub.has(1) && !read_inline_qos(bytes, context.source, false).sound) return Flaw::parameters;
  const std::uint64_t here = std::min(count * size, sample - (first - 1) * size);
  if (!bytes.ok() || bytes.left() < here) return Flaw::fragment;
  context.content.has_fragments = true;
  return Flaw::none;
}

Flaw check_heartbeat(const Submessage& sub, Context& context) {
  RtpsBytes bytes = sub.bytes();
  bytes.skip(4);  // the reader
  const std::uint32_t writer = bytes.entity();
  const std::int64_t first = bytes.sequence_number();
  const std::int64_t last = bytes.sequence_number();
  bytes.skip(4);  // count
  if (!bytes.ok()) return Flaw::length;
  if (!is_number(first) || last < first - 1) return Flaw::numbers;
  return context.guard.admits(context.source, writer, last, SequenceGuard::Step::walked, context.now)
             ? Flaw::none
             : Flaw::jump;
}

Flaw check_gap(const Submessage& sub, Context& context) {
  RtpsBytes bytes = sub.bytes();
  bytes.skip(4);  // the reader
  const std::uint32_t writer = bytes.entity();
  const std::int64_t start = bytes.sequence_number();
  NumberSet set;
  if (const Flaw flaw = read_set(bytes, set, false); flaw != Flaw::none) return flaw;
  if (!is_number(start) || set.base < start) return Flaw::numbers;
  return context.guard.admits(context.source, writer, std::max(set.base - 1, set.highest),
                              SequenceGuard::Step::walked, context.now)
             ? Flaw::none
             : Flaw::jump;
}

Flaw check_acknack(const Submessage& sub) {
  RtpsBytes bytes = sub.bytes();
  bytes.skip(8);  // reader and writer
  NumberSet set;
  if (const Flaw flaw = read_set(bytes, set, false); flaw != Flaw::none) return flaw;
  bytes.skip(4);  // count
  if (!bytes.ok()) return Flaw::length;
  // Base 0 without bits asks for the writer's first heartbeat.
  return set.base == 0 && set.bits > 0 ? Flaw::numbers : Flaw::none;
}

Flaw check_nack_frag(const Submessage& sub, const Context& context) {
  RtpsBytes bytes = sub.bytes();
  bytes.skip(4);  // the reader
  const std::uint32_t writer = bytes.entity();
  const std::int64_t number = bytes.sequence_number();
  NumberSet set;
  if (const Flaw flaw = read_set(bytes, set, true); flaw != Flaw::none) return flaw;
  bytes.skip(4);  // count
  if (!bytes.ok()) return Flaw::length;
  if (!is_number(number) || set.base < 1 || set.highest < set.base) return Flaw::numbers;
  if (set.highest > context.limits.largest_sample / smallest_fragment) return Flaw::numbers;
  return context.guard.has_fragment(writer, number, static_cast<std::uint32_t>(set.highest)) ? Flaw::none
                                                                                             : Flaw::numbers;
}

Flaw check_heartbeat_frag(const Submessage& sub) {
  RtpsBytes bytes = sub.bytes();
  bytes.skip(8);  // reader and writer
  const std::int64_t number = bytes.sequence_number();
  const std::uint32_t last = bytes.u32();
  bytes.skip(4);  // count
  if (!bytes.ok()) return Flaw::length;
  return is_number(number) && last >= 1 ? Flaw::none : Flaw::numbers;
}

/// From here on the message speaks for another participant.
Flaw check_info_source(const Submessage& sub, Context& context) {
  if (context.limits.secured) return Flaw::kind;  // nobody vouches for it
  if (sub.body.size() != header_size) return Flaw::length;
  RtpsBytes bytes = sub.bytes();
  bytes.skip(8);  // unused, version, vendor
  const auto prefix = bytes.take(context.source.size());
  std::copy(prefix.begin(), prefix.end(), context.source.begin());
  return Flaw::none;
}

Flaw check_info_reply(const Submessage& sub) {
  constexpr std::size_t locator = 24;
  RtpsBytes bytes = sub.bytes();
  for (int list = 0; list < (sub.has(1) ? 2 : 1); ++list) {
    const std::size_t count = bytes.u32();
    if (count > bytes.left() / locator) return Flaw::length;
    bytes.skip(count * locator);
  }
  return bytes.ok() ? Flaw::none : Flaw::length;
}

Flaw at_least(const Submessage& sub, std::size_t size) {
  return sub.body.size() < size ? Flaw::length : Flaw::none;
}

/// Security, section 7.3.6 of DDS Security 1.1. A prefix stands before one submessage, a postfix behind; the library walks over
/// lengths in them that it believes.
enum Secure : std::uint8_t { secure_body = 0x30, secure_prefix = 0x31, secure_postfix = 0x32 };

Flaw check_secure_body(const Submessage& sub) {
  RtpsBytes bytes{sub.body, false};  // whatever the flag says, as Fast DDS and Cyclone DDS write it
  const std::size_t size = bytes.u32();
  return bytes.ok() && size <= bytes.left() ? Flaw::none : Flaw::length;
}

/// A tag for all, and one for each of some receivers.
Flaw check_secure_postfix(const Submessage& sub) {
  constexpr std::size_t tag = 16, receiver = 20;
  RtpsBytes bytes{sub.body, false};
  bytes.skip(tag);
  const std::size_t receivers = bytes.u32();
  return bytes.ok() && receivers <= bytes.left() / receiver ? Flaw::none : Flaw::length;
}

/// A prefix, one submessage, a postfix.
Flaw check_secure(const Submessage& sub, Context& context) {
  constexpr std::size_t crypto_header = 20;
  if (!context.limits.secured) return Flaw::kind;
  switch (sub.id) {
    case secure_prefix:
      if (std::exchange(context.behind_prefix, 0) >= 0) return Flaw::kind;
      return sub.body.size() == crypto_header ? Flaw::none : Flaw::length;
    case secure_body:
      if (context.behind_prefix != 0) return Flaw::kind;
      context.behind_prefix = 1;
      return check_secure_body(sub);
    default:
      if (std::exchange(context.behind_prefix, -1) != 1) return Flaw::kind;
      return check_secure_postfix(sub);
  }
}

bool is_secure(std::uint8_t id) { return id >= secure_body && id <= secure_postfix; }

Flaw check(const Submessage& sub, Context& context) {
  switch (sub.id) {
    case secure_body:
    case secure_prefix:
    case secure_postfix:
      return check_secure(sub, context);
    case 0x01:  // PAD
      return Flaw::none;
    case 0x06:
      return check_acknack(sub);
    case 0x07:
      return check_heartbeat(sub, context);
    case 0x08:
      return check_gap(sub, context);
    case 0x09:  // INFO_TS; a flag says that it carries none
      return at_least(sub, sub.has(1) ? 0 : 8);
    case 0x0c:
      return check_info_source(sub, context);
    case 0x0d:  // INFO_REPLY_IP4
      return at_least(sub, sub.has(1) ? 16 : 8);
    case 0x0e:  // INFO_DST
      return at_least(sub, sizeof(GuidPrefix));
    case 0x0f:
      return check_info_reply(sub);
    case 0x12:
      return check_nack_frag(sub, context);
    case 0x13:
      return check_heartbeat_frag(sub);
    case 0x15:
      return check_data(sub, context);
    case 0x16:
      return check_data_frag(sub, context);
    default:  // of security, of later versions, of vendors
      return Flaw::kind;
  }
}

/// Fast DDS appends what it counted. Its reader stops the process where that does not stand at the end, or where its numbers
/// fall; so they are not handed on.
bool is_statistics(const Submessage& sub, const Context& context, bool is_last) {
  constexpr std::size_t statistics_size = 56;
  return sub.id == 0x80 && context.vendor == vendor_fast_dds && is_last && sub.body.size() == statistics_size;
}

bool read_header(RtpsBytes& bytes, Context& context) {
  constexpr std::array magic{std::byte{'R'}, std::byte{'T'}, std::byte{'P'}, std::byte{'S'}};
  const auto name = bytes.take(magic.size());
  const std::uint8_t version = bytes.u8();
  bytes.skip(1);
  context.vendor = bytes.u16();
  const auto prefix = bytes.take(context.source.size());
  if (!bytes.ok() || !std::equal(magic.begin(), magic.end(), name.begin()) || version != 2) return false;
  std::copy(prefix.begin(), prefix.end(), context.source.begin());
  return std::any_of(prefix.begin(), prefix.end(), [](std::byte octet) { return octet != std::byte{}; });
}

}  // namespace

std::string_view flaw_text(Flaw flaw) {
  constexpr std::array<std::string_view, flaws> texts{
      "sound",
      "no RTPS header of version 2",
      "a submessage of wrong length",
      "a kind of submessage that is not expected here",
      "sequence or fragment numbers that cannot be",
      "sequence numbers far beyond the writer's last",
      "a fragment that fits no sample",
      "a payload that is too short",
      "a broken list of inline QoS",
      "broken discovery data, or such of another participant",
  };
  return texts[static_cast<std::size_t>(flaw)];
}

Flaw examine(std::span<const std::byte> message, const RtpsLimits& limits, SequenceGuard& guard,
             RtpsContent& content) {
  content = {};
  Context context{limits, guard, content};
  RtpsBytes header{message.first(std::min(message.size(), header_size)), false};
  if (!read_header(header, context)) return Flaw::header;
  content.source = context.source;
  content.size = header_size;
  while (content.size < message.size()) {
    const auto sub = submessage_at(message, content.size);
    if (!sub) return Flaw::length;
    if (is_statistics(*sub, context, sub->end == message.size())) return Flaw::none;
    if (context.behind_prefix >= 0 && !is_secure(sub->id) && context.behind_prefix++ > 0) return Flaw::kind;
    if (const Flaw flaw = check(*sub, context); flaw != Flaw::none) return flaw;
    content.size = sub->end;
  }
  return context.behind_prefix < 0 ? Flaw::none : Flaw::kind;
}

}  // namespace invar::dds
