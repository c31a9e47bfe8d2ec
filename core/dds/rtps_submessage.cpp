#include "core/dds/rtps_submessage.hpp"

#include <algorithm>

namespace invar::dds {

std::optional<RtpsSubmessage> submessage_at(std::span<const std::byte> message, std::size_t position) {
  constexpr std::size_t head_size = 4;
  constexpr std::uint8_t pad = 0x01;
  constexpr std::uint8_t info_timestamp = 0x09;
  if (position > message.size() || message.size() - position < head_size) return std::nullopt;
  RtpsSubmessage sub;
  sub.id = std::to_integer<std::uint8_t>(message[position]);
  sub.flags = std::to_integer<std::uint8_t>(message[position + 1]);
  RtpsBytes head{message.subspan(position + 2, 2), sub.has(0)};
  std::size_t size = head.u16();
  sub.offset = position + head_size;
  const std::size_t left = message.size() - sub.offset;
  // A length of zero means "to the end", save for those that may be empty.
  if (size == 0 && sub.id != pad && sub.id != info_timestamp) size = left;
  if (size > left) return std::nullopt;
  sub.body = message.subspan(sub.offset, size);
  const std::size_t padded = (size + 3U) & ~std::size_t{3};
  if (padded > left && size != left) return std::nullopt;
  sub.end = sub.offset + std::min(padded, left);
  return sub;
}

}  // namespace invar::dds
