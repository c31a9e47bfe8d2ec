// Types of messages that an OMG IDL text describes, as a tree that decoding follows.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace invar::recording {

enum class Kind : std::uint8_t {
  boolean,
  character,
  octet,  // also uint8
  int8,
  int16,
  uint16,
  int32,
  uint32,
  int64,
  uint64,
  float32,
  float64,
  string,
  enumeration,
  structure,
  sequence,
  array
};

struct Type;
using TypePointer = std::shared_ptr<const Type>;

struct Member {
  std::string name;
  TypePointer type;
  std::string unit;  // of @unit; empty when it has none
  bool key = false;
};

/// `double a[2][3]` is an array of 2 arrays of 3.
struct Type {
  Kind kind{};
  std::string name;               // a::b::T of structures and enumerations
  std::uint32_t bound = 0;        // array: length; string, sequence: most, 0 for any
  TypePointer element{};          // of arrays and sequences
  std::vector<Member> members{};  // of structures
  std::vector<std::pair<std::string, std::int32_t>> enumerators{};  // of enumerations
  std::uint64_t values =
      1;                  // of fixed length within it, arrays multiplied out; octets of an array count as one
  std::size_t depth = 1;  // types within types, itself included
};

/// The structures and enumerations of a text, by scoped name (typedefs are resolved).
struct IdlSchema {
  std::map<std::string, TypePointer> types;

  /// Null when there is none of that name.
  [[nodiscard]] TypePointer find(const std::string& name) const {
    const auto found = types.find(name);
    return found == types.end() ? nullptr : found->second;
  }
};

/// Reads modules, structures, enumerations, typedefs, integer constants, arrays, sequences and strings, primitive
/// types, and the annotations @key and @unit. Other annotations that do not change the bytes are passed over, as are lines
/// that begin with '#'. Set-up only. Throws InputError with `name:line` for a fault in the text, and for types that our CDR
/// cannot carry: unions, maps, bit sets, wide characters, inheritance, @mutable, @optional, @bit_bound.
IdlSchema parse_idl(std::string_view text, const std::string& name);

}  // namespace invar::recording
