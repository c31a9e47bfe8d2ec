// RtpsMessage: whether a received RTPS message is one that the middleware may read, and why not.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace invar::dds {

/// The cause for which a message is dropped; the order is that of `flaw_texts`.
enum class Flaw : std::uint8_t {
  none,
  header,
  length,
  kind,
  numbers,
  jump,
  fragment,
  payload,
  parameters,
  discovery
};
inline constexpr std::size_t flaws = 10;
[[nodiscard]] std::string_view flaw_text(Flaw flaw);

using GuidPrefix = std::array<std::byte, 12>;

/// The writers of discovery and liveliness that each participant has.
enum BuiltinWriter : std::uint32_t {
  participant_writer = 0x000100c2,
  participant_message_writer = 0x000200c2,
  publication_writer = 0x000003c2,
  subscription_writer = 0x000004c2,
  stateless_writer = 0x000201c3,  // of handshakes
};

/// Bounds on counts over which the library loops or for which it allocates, and which only a sender's history can justify.
class SequenceGuard;

/// Limits of this participant.
struct RtpsLimits {
  /// A sample that arrives in fragments [bytes].
  std::uint32_t largest_sample = 8U << 20U;
  /// Shared-memory ports of this domain: the library makes a file for each that a peer names.
  std::uint32_t first_port = 0;
  std::uint32_t last_port = UINT32_MAX;
  /// Submessages of security come, and the middleware is to see the tokens of those who take part.
  bool secured = false;
};

/// Further content of a sound message that the parser found.
struct RtpsContent {
  /// Up to here the middleware reads: a trailing statistics submessage of Fast DDS is not handed on.
  std::size_t size = 0;
  /// The participant for which it speaks; in a secured cell none but its sender.
  GuidPrefix source{};
  bool has_fragments = false;
  /// Parameters of discovery that the middleware must not see: where their ids stand, and how many of them.
  std::array<std::uint32_t, 8> hidden{};
  std::size_t hidden_count = 0;
};

/// Real-time: neither allocates nor locks nor throws. Follows RTPS 2.2, section 9.4 (submessages) and 9.6 (parameters); where
/// Fast DDS 2.9 believes a number that the standard leaves free, the number is bounded here.
[[nodiscard]] Flaw examine(std::span<const std::byte> message, const RtpsLimits& limits, SequenceGuard& guard,
                           RtpsContent& content);

}  // namespace invar::dds
