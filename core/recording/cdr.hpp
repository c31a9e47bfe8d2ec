// CDR (XCDR version 1, plain) driven by an IDL type: payload to value tree and back, either byte order.
#pragma once

#include <bit>
#include <cstdint>
#include <string_view>

#include "core/base/result.hpp"
#include "core/recording/bytes.hpp"
#include "core/recording/value.hpp"

namespace invar::recording {

enum class CdrFault : std::uint8_t {
  encapsulation,  // the first 4 bytes say neither plain CDR big-endian nor little-endian
  too_short,      // ends before the type does
  too_long,       // more than padding is left after the type
  boolean,        // a boolean is neither 0 nor 1
  text,           // a string does not end with its zero byte
  bound,          // a string or sequence is longer than its type allows
  many            // it holds more values than are taken apart (limits::message_values)
};
std::string_view sentence(CdrFault fault);

/// Reads a payload as it stands in a recording: 4 bytes of encapsulation, then the value, at most 3 bytes of padding.
/// Never reads outside of `payload`; memory grows with the payload's size only, whatever its length fields say. An
/// enumeration's value that has no name passes (see Value::enumerator()).
Result<Value, CdrFault> decode(const Type& type, ByteView payload);

/// The payload of a value, with its encapsulation. Precondition: the tree follows its type (as zero() and decode() give
/// it, with lists changed within their bounds).
Bytes encode(const Value& value, std::endian order = std::endian::little);

}  // namespace invar::recording
