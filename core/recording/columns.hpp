// Messages as rows of a table: one column a number or text, named by its field path, with its unit.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "core/recording/value.hpp"

namespace invar::recording {

struct ColumnName {
  std::string path;  // pose.x, samples[3]
  std::string unit;  // of @unit on the member; empty when it has none
};

/// A cell: nothing (an element that this message does not have), a number, or a text.
using Cell = std::variant<std::monostate, std::int64_t, std::uint64_t, double, float, std::string>;

/// Lays a type out as columns. Structures and arrays unfold; a sequence gets a column `path.length` and as many element
/// columns as its longest message has (see widen()); octet sequences get their length only. No array or sequence gets
/// more than `longest` elements; shortened() names those that would have had more. Enumerations and texts are text
/// columns, booleans 0 and 1.
class Columns {
 public:
  /// Throws InputError where there would be more than limits::table_columns; a sequence beyond them is shortened.
  explicit Columns(const Type& type, std::size_t longest = 64);

  /// Makes room for the sequences of a message; call it for every message before the first row.
  void widen(const Value& value);
  /// False when the type has no sequences: widen() changes nothing then.
  [[nodiscard]] bool can_widen() const { return has_sequences_; }

  [[nodiscard]] std::vector<ColumnName> names() const;
  /// The cells of one message, in the order of names(). `row` is overwritten.
  void fill(const Value& value, std::vector<Cell>& row) const;
  /// Paths of arrays and sequences of which elements are left out.
  [[nodiscard]] std::vector<std::string> shortened() const;

 private:
  struct Node {
    const Type* type = nullptr;
    std::string path, unit;
    std::vector<Node> children;
    bool shortened = false;
  };

  Node layout(const Type& type, std::string path, std::string unit);
  void widen(Node& node, const Value& value);
  static void list_names(const Node& node, std::vector<ColumnName>& names);
  static void list_shortened(const Node& node, std::vector<std::string>& paths);
  static void fill(const Node& node, const Value* value, std::vector<Cell>& row);

  std::size_t longest_, columns_ = 0;
  bool has_sequences_ = false;
  Node root_;
};

/// As CSV and JSON write it: the shortest digits that read back as the same number, and nothing for an empty cell and NaN.
/// A text with a comma, quote or line break in it stands within quotes.
void append_cell(std::string& line, const Cell& cell);

}  // namespace invar::recording
