#include "core/component/parameters.hpp"

#include "core/base/shown.hpp"

namespace invar {

namespace {

template <typename Value, typename Show>
std::string bracketed(const std::vector<Value>& values, const Show& show) {
  std::string text;
  for (const Value& value : values) text += (text.empty() ? "" : ", ") + show(value);
  return "[" + text + "]";
}

}  // namespace

void ParameterReader::operator()(std::filesystem::path& value, std::string_view name, std::string_view) {
  if (!node_.has(name)) return;
  const config::Node node = node_[name];
  value = node.as_text();
  if (value.is_relative()) value = folder_ / value;
  std::error_code error;
  if (std::filesystem::exists(value, error) || !node.is_scalar()) return;
  if (error == std::errc::permission_denied)
    node.fault("`" + value.string() + "` cannot be read", "check its permissions and those of its folder");
  else
    node.fault("file `" + value.string() + "` does not exist", "paths count from the cell file's folder");
}

ParameterInfo& ParameterLister::add(std::string_view name, const char* type, std::string_view description) {
  list_.push_back({.path = prefix_ + std::string{name},
                   .type = type,
                   .unit = "",
                   .range = {},
                   .description = std::string{description},
                   .required = false,
                   .otherwise = "",
                   .changeable = false,
                   .number = nullptr});
  return list_.back();
}

void ParameterLister::operator()(double& value, std::string_view name, std::string_view unit, Range range,
                                 std::string_view description, Changeable changeable) {
  ParameterInfo& info = add(name, "number", description);
  info.unit = unit;
  info.range = range;
  info.otherwise = shown(value);
  info.changeable = changeable == while_running;
  if (info.changeable) info.number = &value;
}

void ParameterLister::operator()(std::optional<double>& value, std::string_view name, std::string_view unit,
                                 Range range, std::string_view description, Changeable changeable) {
  ParameterInfo& info = add(name, "number", description);
  info.unit = unit;
  info.range = range;
  if (value) info.otherwise = shown(*value);
  info.changeable = changeable == while_running && value.has_value();
  if (info.changeable) info.number = &*value;
}

void ParameterLister::operator()(std::int64_t& value, std::string_view name, std::int64_t lower,
                                 std::int64_t upper, std::string_view description) {
  ParameterInfo& info = add(name, "whole number", description);
  info.range = {static_cast<double>(lower), static_cast<double>(upper)};
  info.otherwise = std::to_string(value);
}

void ParameterLister::operator()(bool& value, std::string_view name, std::string_view description) {
  add(name, "flag", description).otherwise = value ? "true" : "false";
}
void ParameterLister::operator()(std::string& value, std::string_view name, std::string_view description) {
  add(name, "text", description).otherwise = value;
}
void ParameterLister::operator()(std::filesystem::path& value, std::string_view name,
                                 std::string_view description) {
  add(name, "file", description).otherwise = value.string();
}
void ParameterLister::operator()(std::vector<double>& values, std::string_view name, std::string_view unit,
                                 std::string_view description) {
  ParameterInfo& info = add(name, "list", description);
  info.unit = unit;
  info.otherwise = bracketed(values, [](double value) { return shown(value); });
}
void ParameterLister::operator()(std::vector<double>& values, std::string_view name, std::string_view unit,
                                 Range each, std::string_view description) {
  (*this)(values, name, unit, description);
  list_.back().range = each;
}
void ParameterLister::operator()(Range& value, std::string_view name, std::string_view unit,
                                 std::string_view description) {
  ParameterInfo& info = add(name, "range", description);
  info.unit = unit;
  info.otherwise = "[" + shown(value.lower) + ", " + shown(value.upper) + "]";
}
void ParameterLister::operator()(std::vector<std::string>& values, std::string_view name,
                                 std::string_view description) {
  add(name, "list", description).otherwise =
      bracketed(values, [](const std::string& value) { return value; });
}

}  // namespace invar
