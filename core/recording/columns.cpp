#include "core/recording/columns.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <type_traits>

#include "core/base/fault.hpp"
#include "core/base/limits.hpp"

namespace invar::recording {

namespace {

std::string join(const std::string& path, const std::string& name) {
  return path.empty() ? name : path + "." + name;
}

std::string element_path(const std::string& path, std::size_t index) {
  return path + "[" + std::to_string(index) + "]";
}

bool is_list(const Type& type) { return type.kind == Kind::array || type.kind == Kind::sequence; }

}  // namespace

Columns::Columns(const Type& type, std::size_t longest) : longest_{longest}, root_{layout(type, "", "")} {}

Columns::Node Columns::layout(const Type& type, std::string path, std::string unit) {
  Node node{&type, std::move(path), std::move(unit), {}, false};
  if (++columns_ > limits::table_columns)
    throw InputError{"type `" + type.name + "`",
                     "has more than " + std::to_string(limits::table_columns) + " columns as a table",
                     "export it as JSON (--json), or with fewer elements of its arrays (--elements)"};
  if (type.kind == Kind::structure) {
    for (const Member& member : type.members)
      node.children.push_back(layout(*member.type, join(node.path, member.name), member.unit));
  } else if (type.kind == Kind::array) {
    node.shortened = type.bound > longest_;
    for (std::size_t i = 0; i < std::min<std::size_t>(type.bound, longest_); ++i)
      node.children.push_back(layout(*type.element, element_path(node.path, i), node.unit));
  } else if (type.kind == Kind::sequence) {
    has_sequences_ = true;
  }
  return node;
}

void Columns::widen(const Value& value) {
  if (has_sequences_) widen(root_, value);
}

void Columns::widen(Node& node, const Value& value) {
  const auto* list = std::get_if<std::vector<Value>>(&value.content);
  if (list == nullptr) return;
  if (node.type->kind == Kind::sequence) {
    const std::uint64_t each = 64 * node.type->element->values;  // octets of an array are up to 64 columns
    if (list->size() > longest_) node.shortened = true;
    while (node.children.size() < std::min(list->size(), longest_)) {
      if (columns_ + each > limits::table_columns) {
        node.shortened = true;
        break;
      }
      node.children.push_back(
          layout(*node.type->element, element_path(node.path, node.children.size()), node.unit));
    }
  }
  for (std::size_t i = 0; i < std::min(list->size(), node.children.size()); ++i)
    widen(node.children[i], (*list)[i]);
}

std::vector<ColumnName> Columns::names() const {
  std::vector<ColumnName> names;
  list_names(root_, names);
  return names;
}

void Columns::list_names(const Node& node, std::vector<ColumnName>& names) {
  if (node.type->kind == Kind::sequence) names.push_back({join(node.path, "length"), ""});
  if (node.type->kind != Kind::structure && !is_list(*node.type)) names.push_back({node.path, node.unit});
  for (const Node& child : node.children) list_names(child, names);
}

std::vector<std::string> Columns::shortened() const {
  std::vector<std::string> paths;
  list_shortened(root_, paths);
  return paths;
}

void Columns::list_shortened(const Node& node, std::vector<std::string>& paths) {
  if (node.shortened) paths.push_back(node.path);
  for (const Node& child : node.children) list_shortened(child, paths);
}

void Columns::fill(const Value& value, std::vector<Cell>& row) const {
  row.clear();
  fill(root_, &value, row);
}

void Columns::fill(const Node& node, const Value* value, std::vector<Cell>& row) {
  const auto* list = value != nullptr ? std::get_if<std::vector<Value>>(&value->content) : nullptr;
  const auto* octets = value != nullptr ? std::get_if<Bytes>(&value->content) : nullptr;
  if (node.type->kind == Kind::sequence) {
    if (value == nullptr)
      row.emplace_back();
    else
      row.emplace_back(std::uint64_t{octets != nullptr ? octets->size()
                                     : list != nullptr ? list->size()
                                                       : 0});
  }
  if (node.type->kind == Kind::structure || is_list(*node.type)) {
    for (std::size_t i = 0; i < node.children.size(); ++i) {
      if (octets != nullptr)
        row.emplace_back(std::uint64_t{(*octets)[i]});
      else
        fill(node.children[i], list != nullptr && i < list->size() ? &(*list)[i] : nullptr, row);
    }
    return;
  }
  if (value == nullptr) {
    row.emplace_back();
    return;
  }
  const auto cell = [&](const auto& content) -> Cell {
    using T = std::decay_t<decltype(content)>;
    if constexpr (std::is_same_v<T, bool>)
      return std::uint64_t{content ? 1U : 0U};
    else if constexpr (std::is_same_v<T, Bytes> || std::is_same_v<T, std::vector<Value>>)
      return std::monostate{};
    else
      return content;
  };
  if (node.type->kind == Kind::enumeration)
    row.emplace_back(value->enumerator());
  else if (node.type->kind == Kind::float32)
    row.emplace_back(static_cast<float>(value->number().value_or(0.0)));
  else
    row.push_back(std::visit(cell, value->content));
}

void append_cell(std::string& line, const Cell& cell) {
  const auto add = [&](const auto& content) {
    using T = std::decay_t<decltype(content)>;
    if constexpr (std::is_same_v<T, std::string>) {
      const bool quoted = content.find_first_of(",\"\r\n") != std::string::npos;
      if (quoted) line += '"';
      for (const char c : content) {
        if (c == '"') line += '"';
        line += c;
      }
      if (quoted) line += '"';
    } else if constexpr (!std::is_same_v<T, std::monostate>) {
      if constexpr (std::is_floating_point_v<T>) {
        if (std::isnan(content)) return;
      }
      char digits[40];
      line.append(digits, std::to_chars(digits, digits + sizeof digits, content).ptr);
    }
  };
  std::visit(add, cell);
}

}  // namespace invar::recording
