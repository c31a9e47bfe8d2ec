// Tables as plain text: columns as wide as what stands in them.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

namespace invar::tools {

class TextTable {
 public:
  /// A heading that ends in `>` makes a column whose cells stand at its right edge.
  explicit TextTable(std::vector<std::string> headings);
  /// Precondition: one cell a column.
  void add(std::vector<std::string> cells);
  [[nodiscard]] bool empty() const { return rows_.empty(); }
  void print(std::ostream& out) const;

 private:
  std::vector<std::string> headings_;
  std::vector<bool> right_;
  std::vector<std::vector<std::string>> rows_;
};

/// With `digits` significant ones.
[[nodiscard]] std::string number_text(double value, int digits = 4);
/// Nanoseconds as microseconds, "12.4".
[[nodiscard]] std::string microseconds_text(std::int64_t ns);

}  // namespace invar::tools
