// RtpsParameters: the parameter lists of RTPS - inline QoS, and what participants and endpoints say of themselves.
#pragma once

#include "core/dds/rtps_bytes.hpp"
#include "core/dds/rtps_message.hpp"

namespace invar::dds {

/// Inline QoS of a DATA or DATA_FRAG.
struct InlineQos {
  bool sound = false;
  bool disposes = false;  // the sample ends an instance: no payload need follow
};
[[nodiscard]] InlineQos read_inline_qos(RtpsBytes& bytes, const GuidPrefix& source, bool of_discovery);

/// The payload of a discovery writer, with its encapsulation. `offset`: where it begins in the message, for `content.hidden`.
[[nodiscard]] bool is_sound_discovery(std::span<const std::byte> payload, const GuidPrefix& source,
                                      std::size_t offset, const RtpsLimits& limits, RtpsContent& content);

/// The payload of the writer of handshakes: identities, a class, tokens. Only of a secured cell.
[[nodiscard]] bool is_sound_handshake(std::span<const std::byte> payload);

}  // namespace invar::dds
