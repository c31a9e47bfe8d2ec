// In which form a text table was written: its separator, its header, its comments; found from its first lines.
#pragma once

#include <cstddef>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace invar::recording {

inline constexpr double no_number =
    std::numeric_limits<double>::quiet_NaN();  // of a cell that is empty or says nan

/// A line of the file with its number, from 1.
struct NumberedLine {
  std::size_t number = 0;
  std::string text;
};

/// Without blanks and carriage returns at both ends, and without the quotes about it.
std::string_view trimmed(std::string_view text);
/// Does it begin as a comment does (#, %, //)?
bool is_comment(std::string_view line);

struct TableForm {
  char separator = ',';                // ' ': any run of blanks and tabs
  std::optional<NumberedLine> header;  // nothing: the columns have numbers, from 1
  bool header_is_row = false;          // it is the first line that is no comment

  /// The cells of a line; a separator within double quotes does not separate. One empty cell behind the last is left out
  /// where `expected` cells are there without it.
  void split(std::string_view line, std::vector<std::string_view>& cells, std::size_t expected = 0) const;
};

/// `sample`: the first lines that are neither empty nor comments, at least one; `comment`: the last one before them. Throws
/// InputError where two separators would do equally well.
TableForm form_of(const std::vector<NumberedLine>& sample, const std::optional<NumberedLine>& comment,
                  const std::filesystem::path& file);

/// Numbers as loggers write them: all with a decimal point or all with a decimal comma; nan, na and null are none.
class NumberCells {
 public:
  /// Where commas part the cells too, one within quotes may part thousands ("1,234").
  explicit NumberCells(char separator = ';') : commas_part_{separator == ','} {}

  /// The number of a cell, NaN of an empty one; nothing where the cell is no number or has the other decimal mark than an
  /// earlier one.
  std::optional<double> read(std::string_view cell);
  /// Why a cell was no number.
  [[nodiscard]] std::string flaw(std::string_view cell) const;

 private:
  bool commas_part_;
  char mark_ = 0;  // '.' or ',' once one was seen
};

}  // namespace invar::recording
