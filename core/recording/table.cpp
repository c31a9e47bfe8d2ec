#include "core/recording/table.hpp"

#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <set>
#include <utility>

#include "core/base/contract.hpp"
#include "core/base/limits.hpp"
#include "core/base/name.hpp"
#include "core/base/new_file.hpp"
#include "core/base/shown.hpp"
#include "core/base/unit.hpp"
#include "core/recording/columns.hpp"
#include "core/recording/table_form.hpp"
#include "core/recording/text_lines.hpp"
#include "core/recording/time_stamp.hpp"

namespace invar::recording {

namespace {

/// A cell as a message shows it: a line of some hundred digits says no more than its beginning.
std::string shortened(std::string_view cell) {
  std::size_t most = 20;
  if (cell.size() <= most) return std::string{cell};
  while (most > 0 && (static_cast<unsigned char>(cell[most]) & 0xC0U) == 0x80U) --most;  // inside a letter
  return std::string{cell.substr(0, most)} + "...";
}

/// True for the bracket of `samples[3]`, false for that of `ratio [1]`: an index follows its name at once.
bool is_index(std::string_view cell, std::size_t open) {
  const std::string_view inside = cell.substr(open + 1, cell.size() - open - 2);
  return open > 0 && cell[open - 1] != ' ' && cell.back() == ']' && !inside.empty() &&
         inside.find_first_not_of("0123456789") == std::string_view::npos;
}

/// The round bracket at the end of a header's cell where a unit stands in it; npos where none does: `T (C)`, not `T (left)`.
std::size_t unit_in_round_brackets(std::string_view cell) {
  const auto open = cell.rfind('(');
  if (open == std::string_view::npos || open == 0 || cell.back() != ')') return std::string_view::npos;
  const auto inside = trimmed(cell.substr(open + 1, cell.size() - open - 2));
  const bool is_number = inside.find_first_not_of("0123456789") == std::string_view::npos;
  const bool is_temperature =
      inside == "C" || inside == "F";  // what they measure, who asks for the column knows
  return !is_number && (is_temperature || parse_unit(inside)) ? open : std::string_view::npos;
}

Column header(std::string_view cell, const std::string& where) {
  Column column;
  column.header = std::string{cell};
  auto open = cell.rfind('[');
  char closing = ']';
  if (open != std::string_view::npos && is_index(cell, open)) open = std::string_view::npos;
  if (open == std::string_view::npos) open = unit_in_round_brackets(cell), closing = ')';
  column.name = std::string{trimmed(cell.substr(0, open))};
  if (open != std::string_view::npos) {
    const auto close = cell.find(closing, open);
    if (close == std::string_view::npos)
      throw InputError{where + ": column `" + std::string{cell} + "`", "the unit's bracket is not closed",
                       "write `" + column.name + " [unit]`"};
    column.unit = std::string{trimmed(cell.substr(open + 1, close - open - 1))};
  }
  if (column.name.empty()) throw InputError{where, "a column has no name", "write `name [unit]`"};
  if (const auto flaw = flaw_of_label(cell))
    throw InputError{where + ": column `" + clipped(std::string{cell}) + "`", flaw->what, flaw->mend};
  return column;
}

/// Times of one column as seconds since its first.
class StampCells {
 public:
  /// Throws InputError for a stamp of another kind than the first, or one that may be two days.
  double read(const TimeStamp& stamp, const std::string& where) {
    constexpr std::int64_t day = 86'400'000'000'000, half = day / 2;
    if (!first_) first_ = stamp, last_ = stamp.ns, date_ = stamp.ambiguous;
    if (stamp.has_date != first_->has_date)
      throw InputError{where, "has a date where others have none", "write all times in one form"};
    if (stamp.ambiguous != date_)
      throw InputError{where,
                       "of `" + std::string{stamp.ambiguous.empty() ? date_ : stamp.ambiguous} +
                           "` day and month may be either way round",
                       "write dates as 2024-03-01"};
    auto ns = stamp.ns;
    while (!stamp.has_date && ns < last_ - half) ns += day;  // it is past midnight
    last_ = ns;
    return 1e-9 * static_cast<double>(ns - first_->ns);
  }

 private:
  std::optional<TimeStamp> first_;
  std::string date_;
  std::int64_t last_ = 0;
};

/// What is taken of the columns of a file.
struct Wanted {
  std::vector<std::string> texts;
  std::optional<std::vector<std::string>> only;

  static bool names(const std::vector<std::string>& list, const Column& column) {
    return std::any_of(list.begin(), list.end(),
                       [&](const std::string& name) { return name == column.name || name == column.header; });
  }
  [[nodiscard]] bool takes(const Column& column) const { return !only || names(*only, column); }
};

class Reader {
 public:
  Reader(const std::filesystem::path& file, Wanted wanted, std::vector<std::string> known = {})
      : file_{file}, wanted_{std::move(wanted)}, known_{std::move(known)}, lines_{file} {
    table_.file = file;
  }

  Table run() {
    auto first = first_lines();
    std::vector<NumberedLine> sample = first;
    std::erase_if(sample, [](const NumberedLine& line) { return is_comment(line.text); });
    if (first.empty()) throw InputError{file_.string(), "is empty", "begin with a header `name [unit],...`"};
    check_first(first.front());
    form_ = form_of(sample, comment_, file_);
    read_header(first.front());
    cells_.assign(places_.size(), {NumberCells{form_.separator}, {}});
    std::size_t begin = form_.header_is_row ? 1 : 0;
    if (form_.header_is_row && first.size() > 1 && take_units(first[1])) begin = 2;
    for (std::size_t i = begin; i < first.size(); ++i)
      if (is_row(first[i].text)) read_row(first[i].text, first[i].number);
    first.clear();
    std::string_view line;
    while (next_row(line)) read_row(line, number_);
    for (Column& column : table_.columns) column.values.shrink_to_fit();
    if (rows_ == 0) throw InputError{file_.string(), "has a header but no rows", "add the readings below it"};
    table_.rows_read = rows_;
    return std::move(table_);
  }

 private:
  /// A comment is none where a name may begin as one does: then it has as many cells as a row.
  bool is_row(std::string_view line) {
    if (!is_comment(line)) return true;
    if (is_text_.empty() || !is_text_.front()) return false;
    form_.split(line, split_, count_);
    return split_.size() == count_;
  }

  /// The next row.
  bool next_row(std::string_view& line) {
    while (lines_.next(line)) {
      ++number_;
      if (!trimmed(line).empty() && is_row(line)) return true;
    }
    return false;
  }

  /// The header, and as many lines behind it as tell the form; empty where there is none.
  /// Is it the header behind a preamble?
  [[nodiscard]] bool names_known(std::string_view line) const {
    return std::any_of(known_.begin(), known_.end(),
                       [&](const std::string& name) { return line.find(name) != std::string_view::npos; });
  }

  std::vector<NumberedLine> first_lines() {
    constexpr std::size_t enough = 40, bytes = 1U << 20U;
    std::vector<NumberedLine> first;
    std::size_t size = 0;
    std::string_view line;
    while (first.size() < enough && size < bytes && lines_.next(line)) {
      ++number_;
      if (trimmed(line).empty()) continue;
      NumberedLine one{number_, std::string{line}};
      if (first.empty() && is_comment(line)) {
        comment_ = std::move(one);
        continue;
      }
      size += line.size();
      first.push_back(std::move(one));
      if (names_known(first.back().text) && !behind_) {
        behind_ = true;
        first.erase(first.begin(), first.end() - 1);
      }
    }
    return first;
  }

  [[noreturn]] void refuse(const std::string& at, const std::string& what, const std::string& mend) {
    const InputError fault{at, what, mend};  // its text is the line's, which the rest of the file overwrites
    lines_.check_rest();
    throw fault;
  }
  [[nodiscard]] std::string at(std::size_t number) const {
    return file_.string() + ":" + std::to_string(number);
  }

  void check_first(const NumberedLine& line) {
    if (trimmed(line.text).find('\r') != std::string_view::npos)
      refuse(at(line.number), "the lines end in a carriage return alone",
             "end them in a line feed, as by `tr '\\r' '\\n'`");
  }

  void read_header(const NumberedLine& first) {
    const auto& line = form_.header ? *form_.header : first;
    form_.split(line.text, split_);
    if (split_.size() > limits::csv_columns)
      refuse(at(line.number), "has " + std::to_string(split_.size()) + " columns",
             "use at most " + std::to_string(limits::csv_columns));
    if (split_.size() > 1 && split_.back().empty()) split_.pop_back();  // a separator at each line's end
    count_ = split_.size();
    table_.has_header = form_.header.has_value();
    std::set<std::string> names;
    for (std::size_t i = 0; i < count_; ++i) {
      Column column;
      if (!table_.has_header)
        column.name = std::to_string(i + 1);
      else if (!split_[i].empty() || !wanted_.only)
        column = header(split_[i], at(line.number));
      // Who asks for a number means the place, whatever a comment says.
      if (!form_.header_is_row && wanted_.only &&
          Wanted::names(*wanted_.only, {std::to_string(i + 1), "", {}, {}}))
        column.name = std::to_string(i + 1);
      const bool takes = wanted_.takes(column);
      if (takes && !names.insert(column.name).second)
        refuse(at(line.number), "column `" + column.name + "` stands twice", "keep one of them");
      is_text_.push_back(Wanted::names(wanted_.texts, column));
      if (takes)
        places_.push_back(i), table_.columns.push_back(std::move(column));
      else if (!column.name.empty())
        table_.left_out.push_back(std::move(column.name));
    }
  }

  /// A second line of units alone (`s;degC;W`) below a header without any; not where texts are read, which may look so.
  bool take_units(const NumberedLine& line) {
    form_.split(line.text, split_, count_);
    const auto is_unit = [](std::string_view cell) {
      return cell.empty() || (!NumberCells{}.read(cell) && (cell == "C" || cell == "F" || parse_unit(cell)));
    };
    const bool are_units =
        wanted_.only && split_.size() == count_ && std::all_of(split_.begin(), split_.end(), is_unit) &&
        std::any_of(split_.begin(), split_.end(), [](std::string_view cell) { return !cell.empty(); }) &&
        std::all_of(table_.columns.begin(), table_.columns.end(),
                    [](const Column& column) { return column.unit.empty(); });
    for (std::size_t k = 0; are_units && k < places_.size(); ++k)
      table_.columns[k].unit = std::string{split_[places_[k]]};
    return are_units;
  }

  void read_row(std::string_view line, std::size_t number) {
    form_.split(line, split_, count_);
    ++rows_;
    if (split_.size() != count_)
      refuse(at(number),
             "this row has " + std::to_string(split_.size()) + " cells, the " +
                 (form_.header_is_row ? "header " : "first ") + std::to_string(count_),
             split_.size() > count_ && form_.separator == ','
                 ? "give every row one cell a column; where numbers have decimal commas, part cells by "
                   "semicolons"
                 : "give every row one cell a column (an empty one where a value is missing)");
    for (std::size_t k = 0; k < places_.size(); ++k) {
      Column& column = table_.columns[k];
      const auto cell = split_[places_[k]];
      if (is_text_[places_[k]])
        read_text(column, cell, number);
      else
        column.values.push_back(read_number(k, cell, number));
    }
  }

  void read_text(Column& column, std::string_view cell, std::size_t number) {
    if (const auto flaw = flaw_of_label(cell))
      refuse(at(number) + ": column `" + column.name + "`",
             "`" + clipped(std::string{cell}) + "` " + flaw->what, flaw->mend);
    column.texts.emplace_back(cell);
    column.values.push_back(NumberCells{form_.separator}.read(cell).value_or(no_number));
  }

  double read_number(std::size_t k, std::string_view cell, std::size_t number) {
    Cells& cells = cells_[k];
    Column& column = table_.columns[k];
    if (const auto value = cells.numbers.read(cell); value && (!cells.stamps || std::isnan(*value)))
      return *value;
    const auto stamp = parse_time_stamp(cell);
    const auto where = [&] { return at(number) + ": column `" + column.name + "`"; };
    if (stamp && !cells.stamps && is_empty(column)) cells.stamps.emplace(), column.unit = "s";
    if (stamp && cells.stamps) return cells.stamps->read(*stamp, where());
    refuse(where(),
           "`" + shortened(cell) + "` " + (cells.stamps ? "is not a time" : cells.numbers.flaw(cell)),
           cells.stamps ? "write it as the times before it, such as 2024-03-01T09:00:02.4"
                        : "write a number, or leave the cell empty");
  }

  static bool is_empty(const Column& column) {
    return std::all_of(column.values.begin(), column.values.end(),
                       [](double value) { return std::isnan(value); });
  }

  struct Cells {
    NumberCells numbers;
    std::optional<StampCells> stamps;
  };
  std::filesystem::path file_;
  Wanted wanted_;
  std::vector<std::string> known_;  // names of columns that a header behind a preamble has
  bool behind_ = false;
  TextLines lines_;
  Table table_;
  TableForm form_;
  std::optional<NumberedLine> comment_;
  std::size_t number_ = 0, count_ = 0, rows_ = 0;  // of the line; cells of a row; rows read
  std::vector<bool> is_text_;                      // by column of the file
  std::vector<std::size_t> places_;                // in the file, by column of the table
  std::vector<Cells> cells_;                       // by column of the table
  std::vector<std::string_view> split_;
};

}  // namespace

Table Table::read(const std::filesystem::path& file, const std::vector<std::string>& text_columns) {
  return Reader{file, {text_columns, std::nullopt}}.run();
}

Table Table::read_behind_preamble(const std::filesystem::path& file,
                                  const std::vector<std::string>& text_columns,
                                  const std::vector<std::string>& known) {
  return Reader{file, {text_columns, std::nullopt}, known}.run();
}

Table Table::read_columns(const std::filesystem::path& file, const std::vector<std::string>& wanted) {
  return Reader{file, {{}, wanted}}.run();
}

void Table::write(const std::filesystem::path& target) const {
  std::string text;
  for (const Column& column : columns) {
    if (&column != &columns.front()) text += ',';
    append_cell(text, column.name + (column.unit.empty() ? "" : " [" + column.unit + "]"));
  }
  text += '\n';
  char digits[40];
  for (std::size_t row = 0; row < rows(); ++row) {
    for (const Column& column : columns) {
      if (&column != &columns.front()) text += ',';
      if (!column.texts.empty()) {
        append_cell(text, column.texts[row]);
      } else if (const double value = column.values[row]; std::isinf(value)) {
        text += value > 0 ? "inf" : "-inf";
      } else if (!std::isnan(value)) {
        text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
      }
    }
    text += '\n';
  }
  NewFile out{target};
  const bool compress = target.extension() == ".gz";
  const gzFile stream = gzopen(out.path().c_str(), compress ? "wb6" : "wbT");
  bool written = stream != nullptr;
  for (std::size_t at = 0; written && at < text.size();) {
    const auto size = static_cast<unsigned>(std::min<std::size_t>(text.size() - at, 1U << 20U));
    written = gzwrite(stream, text.data() + at, size) == static_cast<int>(size);
    at += size;
  }
  if (stream != nullptr && gzclose(stream) != Z_OK) written = false;
  if (!written) out.refuse();
  out.finish();
}

std::size_t Table::rows() const { return columns.empty() ? rows_read : columns.front().values.size(); }
bool Table::has(std::string_view name) const { return find(name) != nullptr; }

const Column* Table::find(std::string_view name) const {
  const auto by = [&](auto member) {
    return std::find_if(columns.begin(), columns.end(), [&](const Column& c) { return c.*member == name; });
  };
  auto found = by(&Column::name);
  if (found == columns.end()) found = by(&Column::header);
  return found == columns.end() ? nullptr : &*found;
}

std::string Table::names() const {
  constexpr std::size_t shown = 40;  // a screen of names; a table may have thousands
  const std::size_t count = columns.size() + left_out.size();
  std::string list;
  for (std::size_t i = 0; i < std::min(count, shown); ++i)
    list += (i == 0 ? "" : ", ") + (i < columns.size() ? columns[i].name : left_out[i - columns.size()]);
  return count > shown ? list + " and " + std::to_string(count - shown) + " more" : list;
}

std::vector<double> Table::in(std::string_view name, std::string_view unit) const {
  const Column* column = find(name);
  if (column == nullptr) {
    throw InputError{file.string(),
                     "column `" + std::string{name} + "` is missing (there are: " + names() + ")",
                     "add `" + std::string{name} + " [" + std::string{unit} + "]`"};
  }
  std::vector<double> values = column->values;
  if (column->unit.empty()) return values;
  const auto convert = conversion(column->unit, unit);
  if (!convert)
    throw InputError{file.string() + ": column `" + column->name + " [" + column->unit + "]`",
                     "`" + column->unit +
                         (parse_unit(column->unit) ? "` does not measure the same as " + std::string{unit}
                                                   : "` is no unit"),
                     "write the column in " + std::string{unit}};
  for (double& value : values) value = (*convert)(value);
  return values;
}

std::optional<std::vector<double>> Table::optionally_in(std::string_view name, std::string_view unit) const {
  if (!has(name)) return std::nullopt;
  return in(name, unit);
}

void Table::add(std::string name, std::string unit, std::vector<double> values) {
  INVAR_EXPECTS(columns.empty() || values.size() == rows(), name, values.size(), rows());
  columns.push_back({std::move(name), std::move(unit), std::move(values), {}});
}

void Table::add_texts(std::string name, std::vector<std::string> texts) {
  INVAR_EXPECTS(columns.empty() || texts.size() == rows(), name, texts.size(), rows());
  columns.push_back({std::move(name), "", std::vector<double>(texts.size(), no_number), std::move(texts)});
}

}  // namespace invar::recording
