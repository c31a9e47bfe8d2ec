#include "core/recording/value.hpp"

#include <algorithm>
#include <charconv>

namespace invar::recording {

Value Value::zero(const Type& type) {
  Value value{&type, false};
  switch (type.kind) {
    case Kind::boolean:
      break;
    case Kind::character:
      value.content = std::string(1, '\0');
      break;
    case Kind::octet:
    case Kind::uint16:
    case Kind::uint32:
    case Kind::uint64:
      value.content = std::uint64_t{0};
      break;
    case Kind::int8:
    case Kind::int16:
    case Kind::int32:
    case Kind::int64:
      value.content = std::int64_t{0};
      break;
    case Kind::enumeration:
      value.content = std::int64_t{type.enumerators.front().second};
      break;
    case Kind::float32:
    case Kind::float64:
      value.content = 0.0;
      break;
    case Kind::string:
      value.content = std::string{};
      break;
    case Kind::sequence:
      if (type.element->kind == Kind::octet)
        value.content = Bytes{};
      else
        value.content = std::vector<Value>{};
      break;
    case Kind::array:
      if (type.element->kind == Kind::octet)
        value.content = Bytes(type.bound);
      else
        value.content = std::vector<Value>(type.bound, zero(*type.element));
      break;
    case Kind::structure: {
      std::vector<Value> members;
      members.reserve(type.members.size());
      for (const Member& member : type.members) members.push_back(zero(*member.type));
      value.content = std::move(members);
      break;
    }
  }
  return value;
}

const Value* Value::at(std::string_view path) const {
  const Value* here = this;
  while (!path.empty()) {
    const auto* list = std::get_if<std::vector<Value>>(&here->content);
    if (list == nullptr) return nullptr;
    std::size_t index = 0;
    if (path.front() == '[') {
      const auto close = path.find(']');
      if (close == std::string_view::npos || here->type->kind == Kind::structure) return nullptr;
      const auto [end, error] = std::from_chars(path.data() + 1, path.data() + close, index);
      if (error != std::errc{} || end != path.data() + close) return nullptr;
      path.remove_prefix(close + 1);
    } else {
      if (here != this && path.front() == '.') path.remove_prefix(1);
      const std::string_view name = path.substr(0, path.find_first_of(".["));
      const auto& members = here->type->members;
      const auto found = std::find_if(members.begin(), members.end(),
                                      [&](const Member& member) { return member.name == name; });
      if (name.empty() || found == members.end()) return nullptr;
      index = static_cast<std::size_t>(found - members.begin());
      path.remove_prefix(name.size());
    }
    if (index >= list->size()) return nullptr;
    here = &(*list)[index];
  }
  return here;
}

Value* Value::at(std::string_view path) {
  return const_cast<Value*>(static_cast<const Value&>(*this).at(path));  // NOLINT: this one is not const
}

std::optional<double> Value::number() const {
  if (const auto* it = std::get_if<bool>(&content)) return *it ? 1.0 : 0.0;
  if (const auto* it = std::get_if<std::int64_t>(&content)) return static_cast<double>(*it);
  if (const auto* it = std::get_if<std::uint64_t>(&content)) return static_cast<double>(*it);
  if (const auto* it = std::get_if<double>(&content)) return *it;
  return std::nullopt;
}

std::string Value::enumerator() const {
  const auto* value = std::get_if<std::int64_t>(&content);
  if (type == nullptr || type->kind != Kind::enumeration || value == nullptr) return {};
  for (const auto& [name, number] : type->enumerators)
    if (number == *value) return name;
  return std::to_string(*value);
}

}  // namespace invar::recording
