// A message taken apart: a tree of values that follows its IDL type, reached by field paths.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/recording/bytes.hpp"
#include "core/recording/idl_type.hpp"

namespace invar::recording {

/// One value. The type belongs to the IdlSchema (or TypePointer) it was decoded with, which must live as long.
struct Value {
  /// By kind: boolean bool; character a text of one byte; int8..int64 and enumeration int64; octet, uint16..uint64 uint64;
  /// float32, float64 double; string a text. Arrays and sequences of octets are Bytes, others a list; a structure is a list
  /// of its members in order.
  using Content =
      std::variant<bool, std::int64_t, std::uint64_t, double, std::string, Bytes, std::vector<Value>>;

  const Type* type = nullptr;
  Content content = false;

  /// The zero of a type: false, 0, "", an empty sequence, an array of zeros.
  static Value zero(const Type& type);

  /// The value at "pose.x", "samples[3]" or "points[2].target[0]"; null when there is no such field or element (elements
  /// of octet arrays and sequences are reached by their Bytes).
  [[nodiscard]] const Value* at(std::string_view path) const;
  [[nodiscard]] Value* at(std::string_view path);

  /// The number that a boolean, an integer, a real or an enumeration holds.
  [[nodiscard]] std::optional<double> number() const;
  /// The name of an enumeration's value; its digits when the type has no name for it. Empty for other kinds.
  [[nodiscard]] std::string enumerator() const;
};

}  // namespace invar::recording
