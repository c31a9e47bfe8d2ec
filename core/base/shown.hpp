// Numbers as people read them in messages and tables.
#pragma once

#include <sstream>
#include <string>

#include "core/base/time.hpp"

namespace invar {

/// Without trailing zeros: "0.25", "1e-06".
inline std::string shown(double value, int digits = 6) {
  std::ostringstream text;
  text.precision(digits);
  text << value;
  return text.str();
}

inline std::string milliseconds(Duration time, int digits = 6) {
  return shown(time.in_seconds() * 1e3, digits) + " ms";
}

/// A word of the user's in a message: of a very long one the beginning.
inline std::string clipped(const std::string& word) {
  constexpr std::size_t most = 60;
  if (word.size() <= most) return word;
  std::size_t end = most - 3;
  while (end > 0 && (static_cast<unsigned char>(word[end]) & 0xC0U) == 0x80U)
    --end;  // no half letter of UTF-8
  return word.substr(0, end) + "...";
}

}  // namespace invar
