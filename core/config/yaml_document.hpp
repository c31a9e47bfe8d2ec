// A YAML file as it is asked for: its places with the keys that somebody knows, and its faults.
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/config/fault_list.hpp"

namespace invar::config::detail {

struct Place {
  YAML::Node yaml;
  std::string path;
  std::string key;
  int line = 0;
  bool accept_all = false;
  bool empty = false;  // the key stands there, without a value
  std::set<std::string> known;
  std::vector<std::pair<std::string, std::shared_ptr<Place>>> children;
  std::unordered_map<std::string, std::size_t> child_of;  // by key, into `children`
  std::optional<std::unordered_map<std::string, YAML::Node>>
      values;                                  // of a map, by key; found at the first question
  std::unordered_map<std::string, int> lines;  // of its keys

  void look_at_keys() {
    if (values) return;
    values.emplace();
    for (const auto& entry : yaml) {
      if (!entry.first.IsScalar()) continue;
      if (!values->emplace(entry.first.Scalar(), entry.second).second) continue;
      if (!entry.first.Mark().is_null()) lines[entry.first.Scalar()] = entry.first.Mark().line + 1;
    }
  }
  std::shared_ptr<Place> add(const std::string& name, std::shared_ptr<Place> child) {
    child_of.emplace(name, children.size());
    children.emplace_back(name, child);
    return child;
  }
  [[nodiscard]] std::shared_ptr<Place> child(const std::string& name) const {
    const auto found = child_of.find(name);
    return found == child_of.end() ? nullptr : children[found->second].second;
  }
};

struct Document {
  std::filesystem::path file;
  std::string text;
  std::shared_ptr<Place> root;
  FaultList faults;
};

/// The fault of a place that is needed and not there.
inline constexpr const char* missing = "missing";

/// "file:line: path" of a place.
std::string located(const Document& document, const Place& place);
/// The path of a key below a path.
std::string joined(const std::string& path, const std::string& key);

/// Keys from a place downwards that stand twice (of which the parser would keep the first), and keys that nobody asked for.
void collect_keys(const Document& document, const Place& place, FaultList& faults);

}  // namespace invar::config::detail
