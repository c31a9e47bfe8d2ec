// YAML in, checked values with units out; every fault names file, line, key and how to mend it.
#pragma once

#include <filesystem>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/fault.hpp"
#include "core/base/range.hpp"

namespace YAML {
class Node;
}

namespace invar::config {

namespace detail {
struct Document;
struct Place;
}  // namespace detail

/// A number as users write it: `3.2` or `{value: 3.2, unit: kg, sigma: 0.06}`, already in the unit that was
/// asked for.
struct Quantity {
  double value = 0.0;
  std::optional<double> sigma;  // absent: nothing is known beyond the value; 0: known exactly
};

/// A place in a YAML file. Reading never throws: a missing or wrong value is put on the document's list of
/// faults and a harmless one returned, so that one pass finds all faults. Keys that nobody asked for are
/// faults too
/// (`Yaml::finish`). Set-up only.
class Node {
 public:
  /// "machine.yaml:12: travel.x"
  [[nodiscard]] std::string where() const;
  /// The dotted key path from the root, "travel.x"; empty at the root.
  [[nodiscard]] const std::string& path() const;
  /// The last key of the path.
  [[nodiscard]] std::string key() const;
  [[nodiscard]] bool exists() const;
  [[nodiscard]] bool is_map() const;
  [[nodiscard]] bool is_list() const;
  [[nodiscard]] bool is_scalar() const;
  /// Records a fault at this place, once.
  void fault(std::string what, std::string mend = "") const;
  /// Records that this place is missing; a key beside it that is a misspelling of this one takes the fault's place.
  void missing(std::string mend) const;

  /// Faults of the file so far, unknown keys not counted: what follows from one that was just found need not be told.
  [[nodiscard]] std::size_t fault_count() const;

  [[nodiscard]] bool has(std::string_view name) const;
  /// The child, which may not exist; marks the key as known. A key without value is a fault.
  [[nodiscard]] Node operator[](std::string_view name) const;
  /// The child; a fault when it is missing.
  [[nodiscard]] Node required(std::string_view name) const;
  /// The children of a map in file order (marks all as known), or of a list; a fault where a scalar stands.
  [[nodiscard]] std::vector<Node> children() const;
  /// The children of a list; a fault where something else stands.
  [[nodiscard]] std::vector<Node> list() const;
  /// The children of a map; a fault where something else stands.
  [[nodiscard]] std::vector<Node> map() const;
  /// Accepts every key below this place, for a part that somebody else reads.
  void accept_all() const;

  /// This place as a value. A number may be plain (then in `unit`) or `{value:, unit:, sigma:}`.
  [[nodiscard]] Quantity as_quantity(std::string_view unit, Range range = {}) const;
  [[nodiscard]] double as_number(std::string_view unit, Range range = {}) const;
  [[nodiscard]] std::int64_t as_integer(std::int64_t lower, std::int64_t upper) const;
  [[nodiscard]] std::string as_text() const;
  [[nodiscard]] std::string as_choice(std::initializer_list<std::string_view> choices) const;
  [[nodiscard]] bool as_flag() const;
  /// [lower, upper] with lower < upper.
  [[nodiscard]] Range as_range(std::string_view unit) const;
  [[nodiscard]] std::vector<double> as_numbers(std::string_view unit, Range each = {}) const;
  [[nodiscard]] std::vector<std::string> as_texts() const;

  /// A child as a value; without `otherwise` its absence is a fault.
  [[nodiscard]] double number(std::string_view name, std::string_view unit, Range range = {}) const;
  [[nodiscard]] double number(std::string_view name, std::string_view unit, Range range,
                              double otherwise) const;
  [[nodiscard]] std::int64_t integer(std::string_view name, std::int64_t lower, std::int64_t upper) const;
  [[nodiscard]] std::int64_t integer(std::string_view name, std::int64_t lower, std::int64_t upper,
                                     std::int64_t otherwise) const;
  [[nodiscard]] std::string text(std::string_view name) const;
  [[nodiscard]] std::string text(std::string_view name, std::string_view otherwise) const;
  [[nodiscard]] std::string choice(std::string_view name, std::initializer_list<std::string_view> choices,
                                   std::string_view otherwise = "") const;
  [[nodiscard]] bool flag(std::string_view name, bool otherwise) const;

  /// The parsed YAML below this place, for writing it out again.
  [[nodiscard]] const YAML::Node& raw() const;

 private:
  friend class Yaml;
  [[nodiscard]] std::string shown_scalar() const;
  Node(std::shared_ptr<detail::Document> document, std::shared_ptr<detail::Place> place);
  std::shared_ptr<detail::Document> document_;
  std::shared_ptr<detail::Place> place_;
};

/// A YAML file. Throws InputError when it cannot be read or is no YAML.
class Yaml {
 public:
  static Yaml load(const std::filesystem::path& file);
  /// For tests and for text that has no file; `name` stands where the file's name would.
  static Yaml parse(const std::string& text, const std::string& name);

  [[nodiscard]] Node root() const;
  [[nodiscard]] const std::filesystem::path& file() const;
  /// The text that was read, byte for byte.
  [[nodiscard]] const std::string& text() const;
  /// Adds "unknown key" faults for everything nobody asked for; throws InputError when there is any fault.
  void finish() const;
  /// The faults so far, unknown keys included.
  [[nodiscard]] std::vector<Fault> faults() const;
  /// How many faults were found so far, unknown keys not counted.
  [[nodiscard]] std::size_t fault_count() const;

 private:
  std::shared_ptr<detail::Document> document_;
};

/// The nearest of `choices` to a misspelt `word`, for "did you mean"; empty when none is near.
std::string nearest(std::string_view word, const std::vector<std::string>& choices);

/// Words that a wrong word could have meant, for the end of a message: the nearest of `names`, or all of them.
[[nodiscard]] std::string mend_name(const std::string& word, const std::vector<std::string>& names);

}  // namespace invar::config
