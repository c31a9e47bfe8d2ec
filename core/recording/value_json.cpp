#include "core/recording/value_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

namespace invar::recording {

nlohmann::ordered_json to_json(const Value& value, std::size_t longest) {
  using Json = nlohmann::ordered_json;
  const auto convert = [&](const auto& content) -> Json {
    using T = std::decay_t<decltype(content)>;
    if constexpr (std::is_same_v<T, Bytes>) {
      if (content.size() > longest) return Json{{"bytes", content.size()}};
      return Json(content);
    } else if constexpr (std::is_same_v<T, std::vector<Value>>) {
      if (value.type->kind == Kind::structure) {
        Json object = Json::object();
        for (std::size_t i = 0; i < content.size(); ++i)
          object[value.type->members[i].name] = to_json(content[i], longest);
        return object;
      }
      Json list = Json::array();
      for (const Value& each : content) list.push_back(to_json(each, longest));
      return list;
    } else if constexpr (std::is_same_v<T, double>) {
      return std::isfinite(content) ? Json(content) : Json(nullptr);
    } else {
      return Json(content);
    }
  };
  if (value.type->kind == Kind::enumeration) return value.enumerator();
  return std::visit(convert, value.content);
}

std::string to_json_line(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace invar::recording
