// Little-endian bytes: appending whole numbers, texts and blocks, and reading them back without leaving the
// buffer.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

namespace invar::recording {

using Bytes = std::vector<std::uint8_t>;
using ByteView = std::span<const std::uint8_t>;

/// Stores `value` at `to`, least significant byte first.
template <std::unsigned_integral T>
void store(std::uint8_t* to, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i)
    to[i] = static_cast<std::uint8_t>((std::uint64_t{value} >> (8U * i)) & 0xFFU);
}

template <std::unsigned_integral T>
void put(Bytes& out, T value) {
  std::array<std::uint8_t, sizeof(T)> bytes;
  store(bytes.data(), value);
  out.insert(out.end(), bytes.begin(), bytes.end());
}

inline void put(Bytes& out, ByteView bytes) { out.insert(out.end(), bytes.begin(), bytes.end()); }

/// A text as MCAP writes it: 32-bit length, then the characters.
inline void put_text(Bytes& out, std::string_view text) {
  put(out, static_cast<std::uint32_t>(text.size()));
  out.insert(out.end(), text.begin(), text.end());
}

/// Reads from front to back. A read beyond the end gives zero or nothing and makes ok() false for good.
class Cursor {
 public:
  explicit Cursor(ByteView bytes) : rest_{bytes} {}

  template <std::unsigned_integral T>
  T take() {
    if (!has(sizeof(T))) return 0;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) value |= std::uint64_t{rest_[i]} << (8U * i);
    rest_ = rest_.subspan(sizeof(T));
    return static_cast<T>(value);
  }

  ByteView bytes(std::uint64_t count) {
    if (!has(count)) return {};
    const ByteView taken = rest_.first(count);
    rest_ = rest_.subspan(taken.size());
    return taken;
  }

  /// A text with its 32-bit length before it.
  std::string_view text() {
    const ByteView taken = bytes(take<std::uint32_t>());
    return {reinterpret_cast<const char*>(taken.data()), taken.size()};
  }

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] bool empty() const { return rest_.empty(); }
  [[nodiscard]] ByteView rest() const { return rest_; }

 private:
  bool has(std::uint64_t count) {
    if (count > rest_.size()) {
      ok_ = false;
      rest_ = {};
    }
    return ok_;
  }

  ByteView rest_;
  bool ok_ = true;
};

}  // namespace invar::recording
