// Parameters: declared once by `describe`; reading, checking, documenting and changing them follow from it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/folder.hpp"
#include "core/base/range.hpp"
#include "core/base/shown.hpp"
#include "core/config/yaml.hpp"

namespace invar {

/// Whether a parameter may change while the component runs.
enum class Changeable : bool { no, while_running };
inline constexpr Changeable while_running = Changeable::while_running;

/// One row of a component's documentation, and the handle by which a number is changed while running.
struct ParameterInfo {
  std::string path;  // "trajectory.velocity"
  std::string type;  // number, whole number, flag, text, file, list
  std::string unit;
  Range range;
  std::string description;
  bool required = false;
  std::string otherwise;  // the default, as text
  bool changeable = false;
  double* number = nullptr;  // changeable numbers only
};

namespace detail {
struct Probe {
  template <class... Arguments>
  void operator()(Arguments&&...) {}
};
}  // namespace detail

/// A struct with `void describe(auto& p)` is a group of parameters.
template <class T>
concept Described = requires(T& group, detail::Probe& probe) {
  group.describe(probe);
};

/// The visitor that reads parameters from a cell file. In `describe`:
///
///   p(cutoff, "cutoff", "Hz", Range{0.1, 450.0}, "-3 dB corner", while_running);  double, its unit and bounds
///   p(count, "count", 1, 64, "readings a point");                                 std::int64_t with bounds
///   p(enabled, "enabled", "...");                                                 bool
///   p(map, "map", "...");                                                         std::string, path
///   p(limits, "limits", "N", "...");                                              std::vector<double>, Range
///   p(speeds, "speeds", "m/s", Range{1e-4, 1.0}, "...");                          std::vector<double>, not empty
///   p(trajectory, "trajectory", "...");                                           a described group
///   p(lines, "lines", "...");                                                     a vector of such groups
///
/// std::optional<T> may be absent; everything else keeps the default of the struct where the file says nothing. Only a double
/// may be `while_running`; a number without unit has the unit "".
class ParameterReader {
 public:
  explicit ParameterReader(config::Node node, std::filesystem::path folder = {})
      : node_{std::move(node)}, folder_{std::move(folder)} {}

  void operator()(double& value, std::string_view name, std::string_view unit, Range range, std::string_view,
                  Changeable = Changeable::no) {
    if (node_.has(name)) value = node_[name].as_number(unit, range);
  }
  void operator()(std::optional<double>& value, std::string_view name, std::string_view unit, Range range,
                  std::string_view, Changeable = Changeable::no) {
    if (node_.has(name)) value = node_[name].as_number(unit, range);
  }
  void operator()(std::int64_t& value, std::string_view name, std::int64_t lower, std::int64_t upper,
                  std::string_view) {
    if (node_.has(name)) value = node_[name].as_integer(lower, upper);
  }
  void operator()(bool& value, std::string_view name, std::string_view) {
    if (node_.has(name)) value = node_[name].as_flag();
  }
  void operator()(std::string& value, std::string_view name, std::string_view) {
    if (node_.has(name)) value = node_[name].as_text();
  }
  /// Relative paths count from the cell file's folder. That the file exists is checked here.
  void operator()(std::filesystem::path& value, std::string_view name, std::string_view);
  void operator()(std::vector<double>& value, std::string_view name, std::string_view unit,
                  std::string_view) {
    if (node_.has(name)) value = node_[name].as_numbers(unit);
  }
  void operator()(std::vector<double>& value, std::string_view name, std::string_view unit, Range each,
                  std::string_view) {
    if (!node_.has(name)) return;
    value = node_[name].as_numbers(unit, each);
    if (node_[name].is_list() && value.empty())
      node_[name].fault("holds no number", "write one at least, or leave it out");
  }
  void operator()(Range& value, std::string_view name, std::string_view unit, std::string_view) {
    if (node_.has(name)) value = node_[name].as_range(unit);
  }
  void operator()(std::vector<std::string>& value, std::string_view name, std::string_view) {
    if (node_.has(name)) value = node_[name].as_texts();
  }
  template <Described Group>
  void operator()(Group& group, std::string_view name, std::string_view) {
    if (!node_.has(name)) return;
    ParameterReader inner{node_[name], folder_};
    group.describe(inner);
  }
  template <Described Group>
  void operator()(std::optional<Group>& group, std::string_view name, std::string_view text) {
    if (!node_.has(name)) return;
    (*this)(group.emplace(), name, text);
  }
  template <Described Group>
  void operator()(std::vector<Group>& groups, std::string_view name, std::string_view) {
    if (!node_.has(name)) return;
    groups.clear();
    for (const auto& child : node_[name].list()) {
      ParameterReader inner{child, folder_};
      groups.emplace_back().describe(inner);
    }
  }

  /// For checks between parameters, inside `describe`: if (p.reading()) ... p.node().fault("...", "...").
  [[nodiscard]] const config::Node& node() const { return node_; }
  static constexpr bool reading() { return true; }

 private:
  config::Node node_;
  std::filesystem::path folder_;
};

/// The visitor that documents parameters and finds the handles of those that may change while running.
class ParameterLister {
 public:
  explicit ParameterLister(std::vector<ParameterInfo>& list, std::string prefix = "")
      : list_{list}, prefix_{std::move(prefix)} {}

  void operator()(double& value, std::string_view name, std::string_view unit, Range range,
                  std::string_view description, Changeable changeable = Changeable::no);
  void operator()(std::optional<double>& value, std::string_view name, std::string_view unit, Range range,
                  std::string_view description, Changeable changeable = Changeable::no);
  void operator()(std::int64_t& value, std::string_view name, std::int64_t lower, std::int64_t upper,
                  std::string_view description);
  void operator()(bool& value, std::string_view name, std::string_view description);
  void operator()(std::string& value, std::string_view name, std::string_view description);
  void operator()(std::filesystem::path& value, std::string_view name, std::string_view description);
  void operator()(std::vector<double>& value, std::string_view name, std::string_view unit,
                  std::string_view description);
  void operator()(std::vector<double>& value, std::string_view name, std::string_view unit, Range each,
                  std::string_view description);
  void operator()(Range& value, std::string_view name, std::string_view unit, std::string_view description);
  void operator()(std::vector<std::string>& value, std::string_view name, std::string_view description);
  template <Described Group>
  void operator()(Group& group, std::string_view name, std::string_view) {
    ParameterLister inner{list_, prefix_ + std::string{name} + "."};
    group.describe(inner);
  }
  template <Described Group>
  void operator()(std::optional<Group>& group, std::string_view name, std::string_view description) {
    if (group) {
      (*this)(*group, name, description);
    } else {
      Group example;
      const auto first = list_.size();
      (*this)(example, name, description);
      for (auto i = first; i < list_.size(); ++i) list_[i].number = nullptr;
    }
  }
  template <Described Group>
  void operator()(std::vector<Group>& groups, std::string_view name, std::string_view description) {
    if (groups.empty()) {
      Group example;
      const auto first = list_.size();
      (*this)(example, std::string{name} + "[]", description);
      for (auto i = first; i < list_.size(); ++i) list_[i].number = nullptr;
    }
    for (std::size_t i = 0; i < groups.size(); ++i)
      (*this)(groups[i], std::string{name} + "[" + std::to_string(i) + "]", description);
  }
  static constexpr bool reading() { return false; }

 private:
  ParameterInfo& add(std::string_view name, const char* type, std::string_view description);
  std::vector<ParameterInfo>& list_;
  std::string prefix_;
};

/// A fault where no folder can stand under the name that `key` gives.
inline void check_folder(const config::Node& node, std::string_view key, const std::string& folder) {
  if (const auto flaw = flaw_of_folder(folder))
    node[key].fault("`" + clipped(folder) + "` " + *flaw, "name a folder, or one that can be created");
}

/// Objection of the checks between parameters in `describe` to these numbers; empty: none. The numbers stand beside the list
/// of infos; those that may not change are not read. Any thread.
using ParameterCheck = std::function<std::string(std::span<const double> numbers)>;

/// The same for parameters as they were read from the file.
template <Described Parameters>
std::string objection_to(Parameters parameters, std::span<const double> numbers) {
  std::vector<ParameterInfo> infos;
  ParameterLister lister{infos};
  parameters.describe(lister);
  for (std::size_t i = 0; i < std::min(infos.size(), numbers.size()); ++i)
    if (infos[i].number != nullptr) *infos[i].number = numbers[i];
  // Nothing stands in this file, so that nothing is read and only the checks remain.
  const auto file = config::Yaml::parse("{}", "");
  ParameterReader reader{file.root()};
  parameters.describe(reader);
  const auto faults = file.faults();
  return faults.empty()
             ? ""
             : faults.front().what + (faults.front().mend.empty() ? "" : "; " + faults.front().mend);
}

}  // namespace invar
