#include "tools/live/parameter_json.hpp"

#include <cmath>
#include <cstdio>
#include <limits>

namespace invar::tools {

namespace {

using Json = nlohmann::ordered_json;

/// A text that stands for a number, a flag or a list of them becomes one; any other stays what it is.
Json typed(const std::string& text, const std::string& type) {
  if (text.empty()) return type == "text" || type == "file" ? Json("") : Json();
  if (type == "text" || type == "file") return text;
  Json json = Json::parse(text, nullptr, false);
  return json.is_discarded() || json.is_object() ? Json(text) : json;
}

Json bound(double value) { return std::isfinite(value) ? Json(value) : Json(); }

}  // namespace

Json json_of(const ShownParameter& p) {
  const bool runs = !p.component.empty();
  return {{"component", runs ? Json(p.component) : Json()},
          {"path", p.path},
          {"type", p.type},
          {"unit", p.unit},
          {"value", runs ? typed(p.value, p.type) : Json()},
          {"default", runs ? Json() : typed(p.otherwise, p.type)},
          {"lower", bound(p.range.lower)},
          {"upper", bound(p.range.upper)},
          {"while_running", p.while_running},
          {"description", p.description}};
}

Range range_of(const std::string& bounds) {
  constexpr double none = std::numeric_limits<double>::infinity();
  Range range{-none, none};
  if (std::sscanf(bounds.c_str(), "[%lf, %lf]", &range.lower, &range.upper) != 2) range = {-none, none};
  return range;
}

}  // namespace invar::tools
