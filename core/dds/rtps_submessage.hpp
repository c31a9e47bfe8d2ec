// RtpsSubmessage: the parts of an RTPS message, one after the other.
#pragma once

#include <optional>

#include "core/dds/rtps_bytes.hpp"

namespace invar::dds {

inline constexpr std::size_t rtps_header_size = 20;

struct RtpsSubmessage {
  std::uint8_t id = 0;
  std::uint8_t flags = 0;
  std::span<const std::byte> body;
  std::size_t offset = 0;  // of the body in the message
  std::size_t end = 0;     // where the next one begins

  [[nodiscard]] bool has(unsigned bit) const { return (flags >> bit & 1U) != 0; }
  [[nodiscard]] RtpsBytes bytes() const { return {body, has(0)}; }
};

/// The submessage that begins at `position`; nothing where it does not fit into the message. Real-time.
[[nodiscard]] std::optional<RtpsSubmessage> submessage_at(std::span<const std::byte> message,
                                                          std::size_t position);

}  // namespace invar::dds
