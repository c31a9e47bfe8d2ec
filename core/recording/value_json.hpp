// A value tree as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/recording/value.hpp"

namespace invar::recording {

/// Structures become objects with their members in order, arrays and sequences lists, enumerations their names. Numbers
/// that JSON has no word for (NaN, infinities) become null. Octets become a list of numbers, but a list longer than
/// `longest` becomes {"bytes": length}: an image has no place in a line of text.
nlohmann::ordered_json to_json(const Value& value, std::size_t longest = 64);

/// The JSON on one line; bytes that are no UTF-8 are replaced.
std::string to_json_line(const nlohmann::ordered_json& json);

}  // namespace invar::recording
