// Table: columns of numbers with units, read from and written to CSV (plain or gzip).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/fault.hpp"

namespace invar::recording {

struct Column {
  std::string name;
  std::string unit;            // as written in the header; empty when none was
  std::vector<double> values;  // NaN where a cell is empty or says nan
  std::vector<std::string>
      texts;                // filled only for a column that is not all numbers (a line's name, an image's)
  std::string header = {};  // the whole cell of the header, `T (C)`; empty where none was read
};

/// A header `name [unit]` or `name (unit)` a column, then one row a sample. All columns have the same length. Commas,
/// semicolons, tabs, bars or blanks part the cells; numbers have a decimal point or a decimal comma. Lines that begin with
/// #, % or // are comments. The last comment before rows of numbers alone is their header where it has as
/// many cells. Without a header the columns have numbers, from 1. A column of times (2024-03-01T09:00:02.4) counts the
/// seconds since its first.
class Table {
 public:
  /// Throws InputError with file, row, column, fault and mend. Faults: the file cannot be read, has no rows, a row has another
  /// number of cells, a name stands twice, or a cell of a number column is no number. Columns named in `text_columns` may
  /// hold texts; any other may not.
  static Table read(const std::filesystem::path& file, const std::vector<std::string>& text_columns = {});
  /// The same where lines of any kind may stand in front of the header: it is the first line that names one of `known`.
  static Table read_behind_preamble(const std::filesystem::path& file,
                                    const std::vector<std::string>& text_columns,
                                    const std::vector<std::string>& known);
  /// The same of these columns alone, as far as they are there; the others may hold anything.
  static Table read_columns(const std::filesystem::path& file, const std::vector<std::string>& wanted);

  /// Writes through a temporary file beside it, so that nothing half-written is left; `.gz` compresses. 17
  /// digits.
  void write(const std::filesystem::path& file) const;

  [[nodiscard]] std::size_t rows() const;
  [[nodiscard]] bool has(std::string_view name) const;
  [[nodiscard]] const Column* find(std::string_view name) const;
  /// The column in `unit` (a column without a unit counts as in `unit` already). Throws InputError when it is
  /// missing or its unit measures something else.
  [[nodiscard]] std::vector<double> in(std::string_view name, std::string_view unit) const;
  /// The same where the column may be absent.
  [[nodiscard]] std::optional<std::vector<double>> optionally_in(std::string_view name,
                                                                 std::string_view unit) const;

  void add(std::string name, std::string unit, std::vector<double> values);
  void add_texts(std::string name, std::vector<std::string> texts);

  /// The names of all columns of the file, read or not: "t, T, P".
  [[nodiscard]] std::string names() const;

  std::vector<Column> columns;
  std::vector<std::string> left_out;  // names of columns that were not asked for
  bool has_header = true;             // false: columns go by their numbers
  std::filesystem::path file;         // where it was read from, for messages
  std::size_t rows_read = 0;          // of the file, also where none of its columns were asked for
  std::size_t before = 0,
              behind = 0;  // rows of a cell's recording that were not taken, in front of these and after
};

}  // namespace invar::recording
