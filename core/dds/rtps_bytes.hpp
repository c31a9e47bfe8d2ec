// RtpsBytes: reads numbers from received bytes in either byte order, never beyond their end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace invar::dds {

/// Reading past the end gives zero and makes `ok()` false for good; so a caller reads everything and asks once.
class RtpsBytes {
 public:
  RtpsBytes(std::span<const std::byte> bytes, bool little_endian) : bytes_{bytes}, little_{little_endian} {}

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] bool little_endian() const { return little_; }
  [[nodiscard]] std::size_t position() const { return position_; }
  [[nodiscard]] std::size_t left() const { return bytes_.size() - position_; }
  [[nodiscard]] std::span<const std::byte> rest() const { return bytes_.subspan(position_); }

  std::uint8_t u8() { return static_cast<std::uint8_t>(number<1>()); }
  std::uint16_t u16() { return static_cast<std::uint16_t>(number<2>()); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(number<4>()); }
  std::int32_t i32() { return static_cast<std::int32_t>(number<4>()); }
  /// A sequence number: its high word stands first in both byte orders.
  std::int64_t sequence_number() {
    const std::int64_t high = i32();
    return high * (std::int64_t{1} << 32) + u32();
  }
  /// Four octets as they stand, the first one highest: entity ids know no byte order.
  std::uint32_t entity() {
    const auto octets = take(4);
    std::uint32_t id = 0;
    for (const std::byte octet : octets) id = id << 8U | std::to_integer<std::uint32_t>(octet);
    return id;
  }
  std::span<const std::byte> take(std::size_t count) {
    if (count > left()) {
      ok_ = false;
      return {};
    }
    const auto taken = bytes_.subspan(position_, count);
    position_ += count;
    return taken;
  }
  void skip(std::size_t count) { take(count); }

 private:
  template <std::size_t size>
  std::uint64_t number() {
    const auto octets = take(size);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < octets.size(); ++i)
      value = value << 8U | std::to_integer<std::uint64_t>(octets[little_ ? octets.size() - 1 - i : i]);
    return value;
  }

  std::span<const std::byte> bytes_;
  std::size_t position_ = 0;
  bool little_;
  bool ok_ = true;
};

}  // namespace invar::dds
