// Tables as plain text: columns as wide as what stands in them, wrapped where the line would be longer than the terminal.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

namespace invar::tools {

/// Letters that a line may hold: COLUMNS where it is set, else the terminal's width, else 80.
[[nodiscard]] std::size_t line_width();
/// The output goes to a terminal, or COLUMNS says how wide lines may be; else to a program or a file.
[[nodiscard]] bool is_shown_to_a_person();

class TextTable {
 public:
  /// A heading that ends in `>` makes a column of numbers: at its right edge, never wrapped.
  explicit TextTable(std::vector<std::string> headings);
  /// Precondition: one cell a column.
  void add(std::vector<std::string> cells);
  [[nodiscard]] bool empty() const { return rows_.empty(); }
  void print(std::ostream& out, std::size_t width = line_width()) const;

 private:
  using Row = std::vector<std::string>;
  struct Layout {
    std::vector<std::size_t> widths;
    std::size_t gap;
  };
  [[nodiscard]] Layout layout_within(std::size_t width) const;
  void print_row(const Row& row, const Layout& layout, std::ostream& out) const;

  std::vector<std::string> headings_;
  std::vector<bool> right_;
  std::vector<Row> rows_;
};

/// The text in lines of at most `width`: broken at spaces, within a long word behind a sign such as `/`, else anywhere.
[[nodiscard]] std::vector<std::string> wrapped(const std::string& text, std::size_t width);
/// In lines of the terminal; all but the first begin with `indent` spaces.
void print_wrapped(const std::string& text, std::size_t indent, std::ostream& out);

/// With `digits` significant ones.
[[nodiscard]] std::string number_text(double value, int digits = 4);
/// Nanoseconds as microseconds, "12.4".
[[nodiscard]] std::string microseconds_text(std::int64_t ns);

}  // namespace invar::tools
