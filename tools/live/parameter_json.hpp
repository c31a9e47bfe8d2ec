// The one shape of a parameter for programs (docs/reference-json.md): `param` and `types` show it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "core/base/range.hpp"

namespace invar::tools {

struct ShownParameter {
  std::string component;  // empty: of a type, not of a running component
  std::string path, type, unit;
  std::string value;      // as it is now; empty with `otherwise`
  std::string otherwise;  // the default
  Range range;
  bool while_running = false;
  std::string description;
};

/// Numbers as numbers, flags as booleans, lists as lists; a bound that is none is null.
[[nodiscard]] nlohmann::ordered_json json_of(const ShownParameter& parameter);
/// "[0, 450]", as a running component says it; anything else: no bounds.
[[nodiscard]] Range range_of(const std::string& bounds);

}  // namespace invar::tools
