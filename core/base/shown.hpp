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

}  // namespace invar
