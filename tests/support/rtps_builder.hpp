// RtpsBuilder: RTPS messages written octet by octet, sound or not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace invar::testing {

/// Little-endian throughout. What is appended may say anything: nothing is checked.
class RtpsBuilder {
 public:
  static constexpr std::uint8_t prefix_octet = 0x5a;

  explicit RtpsBuilder(std::uint16_t vendor = 0x010f) {
    text("RTPS");
    u8(2), u8(3), u8(static_cast<std::uint8_t>(vendor >> 8U)), u8(static_cast<std::uint8_t>(vendor));
    prefix();
  }
  RtpsBuilder& u8(std::uint8_t value) {
    bytes_.push_back(std::byte{value});
    return *this;
  }
  RtpsBuilder& u16(std::uint32_t value) { return u8(value & 0xffU).u8(value >> 8U & 0xffU); }
  RtpsBuilder& u32(std::uint32_t value) { return u16(value & 0xffffU).u16(value >> 16U); }
  RtpsBuilder& number(std::int64_t value) {
    return u32(static_cast<std::uint32_t>(value >> 32)).u32(static_cast<std::uint32_t>(value));
  }
  RtpsBuilder& entity(std::uint32_t id) {
    for (const unsigned shift : {24U, 16U, 8U, 0U}) u8(static_cast<std::uint8_t>(id >> shift));
    return *this;
  }
  RtpsBuilder& prefix() { return fill(12, prefix_octet); }
  RtpsBuilder& fill(std::size_t count, std::uint8_t value = 0) {
    bytes_.insert(bytes_.end(), count, std::byte{value});
    return *this;
  }
  RtpsBuilder& text(std::string_view characters) {
    for (const char c : characters) u8(static_cast<std::uint8_t>(c));
    return *this;
  }
  /// Begins a submessage; the one before is ended. Its length is set by `end`.
  RtpsBuilder& begin(std::uint8_t id, std::uint8_t flags = 1) {
    end();
    u8(id).u8(flags).u16(0);
    open_ = bytes_.size();
    return *this;
  }
  RtpsBuilder& end() {
    if (open_ == 0) return *this;
    const std::size_t size = bytes_.size() - open_;
    bytes_[open_ - 2] = static_cast<std::byte>(size);
    bytes_[open_ - 1] = static_cast<std::byte>(size >> 8U);
    open_ = 0;
    return *this;
  }
  /// A parameter of a list, its value padded to four.
  RtpsBuilder& parameter(std::uint16_t id, const std::vector<std::uint8_t>& value) {
    u16(id).u16(static_cast<std::uint32_t>(value.size()));
    for (const std::uint8_t octet : value) u8(octet);
    return *this;
  }
  RtpsBuilder& sentinel() { return u16(1).u16(0); }

  /// The head of DATA up to its payload.
  RtpsBuilder& data(std::uint8_t flags, std::uint32_t writer, std::int64_t sequence) {
    return begin(0x15, flags | 1U).u16(0).u16(16).entity(0).entity(writer).number(sequence);
  }
  struct Fragment {
    std::uint32_t first = 1, count = 1, size = 1000, sample = 5000;
    std::size_t payload = 1000;
    std::int64_t sequence = 1;
    std::uint32_t writer = 0x00000103;
  };
  RtpsBuilder& fragment(const Fragment& f, std::uint8_t flags = 1) {
    begin(0x16, flags).u16(0).u16(28).entity(0).entity(f.writer).number(f.sequence);
    return u32(f.first).u16(f.count).u16(f.size).u32(f.sample).fill(f.payload, 7);
  }
  RtpsBuilder& heartbeat(std::int64_t first, std::int64_t last, std::uint32_t writer = 0x00000103) {
    return begin(0x07).entity(0).entity(writer).number(first).number(last).u32(1);
  }
  /// Discovery data of a writer, up to its first parameter.
  RtpsBuilder& discovery(std::uint32_t writer) { return data(5, writer, 1).u16(0x0300).u16(0); }
  RtpsBuilder& guid(std::uint16_t id, std::uint8_t octet = prefix_octet) {
    return u16(id).u16(16).fill(12, octet).entity(0x000001c1);
  }

  [[nodiscard]] std::vector<std::byte> bytes() {
    end();
    return bytes_;
  }

 private:
  std::vector<std::byte> bytes_;
  std::size_t open_ = 0;
};

}  // namespace invar::testing
