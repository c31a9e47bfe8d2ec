#include "core/recording/table.hpp"

#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <memory>
#include <set>
#include <utility>

#include "core/base/contract.hpp"
#include "core/base/input_file.hpp"
#include "core/base/limits.hpp"
#include "core/base/name.hpp"
#include "core/base/new_file.hpp"
#include "core/base/shown.hpp"
#include "core/base/unit.hpp"
#include "core/recording/columns.hpp"

namespace invar::recording {

namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

/// The lines of a text file, plain or gzip, unpacked block by block: an hour at 1 kHz is hundreds of megabytes of text.
class Lines {
 public:
  explicit Lines(const std::filesystem::path& file) : file_{file.string()} {
    stream_.reset(gzdopen(open_input(file, "a CSV file"), "rb"));  // reads plain files too
    if (!stream_) throw InputError{file_, "cannot be read", "check the path and its permissions"};
    (void)gzbuffer(stream_.get(), 1U << 17U);
    more();
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
  }

  /// The next line without its end, good until the next call; false where there are no more.
  bool next(std::string_view& line) {
    auto end = text_.find('\n', at_);
    while (end == std::string::npos && !ended_) {
      const std::size_t seen = text_.size() - at_;
      if (seen > limits::csv_line)
        throw InputError{file_ + ":" + std::to_string(lines_ + 1),
                         "a line has more than " + std::to_string(limits::csv_line / limits::mib) + " MiB",
                         "name a CSV file: a header, then one row a sample"};
      more();
      end = text_.find('\n', at_ + seen);
    }
    if (at_ >= text_.size()) return false;
    ++lines_;
    line = std::string_view{text_}.substr(at_, end == std::string::npos ? end : end - at_);
    at_ = end == std::string::npos ? text_.size() : end + 1;
    return true;
  }
  /// Throws where the rest of the file is damaged: that is what is wrong with it then, whatever a line seems to lack.
  void check_rest() {
    if (gzdirect(stream_.get()) != 0) return;  // not packed: nothing is damaged
    while (!ended_) at_ = text_.size(), more();
  }

 private:
  void more() {
    text_.erase(0, std::exchange(at_, 0));
    const std::size_t kept = text_.size();
    text_.resize(kept + block);
    const int got = gzread(stream_.get(), text_.data() + kept, static_cast<unsigned>(block));
    if (got < 0) throw InputError{file_, "is damaged (gzip cannot unpack it)", "copy the file again"};
    text_.resize(kept + static_cast<std::size_t>(got));
    unpacked_ += static_cast<std::uint64_t>(got);
    check_size();
    if (text_.find('\0', kept) != std::string::npos)
      throw InputError{file_, "is not a text file", "name a CSV file"};
    if (got > 0) return;
    ended_ = true;
    int status = 0;
    gzerror(stream_.get(), &status);
    if (status == Z_BUF_ERROR) throw InputError{file_, "is cut off (gzip ends early)", "copy the file again"};
  }

  /// What is packed must not grow without end; numbers shrink to a third or a tenth.
  void check_size() const {
    const auto packed = static_cast<std::uint64_t>(std::max<z_off_t>(gzoffset(stream_.get()), 0));
    if (gzdirect(stream_.get()) != 0 ||
        unpacked_ <= limits::csv_unpacked_free + limits::csv_unpacked_times * packed)
      return;
    throw InputError{file_,
                     "unpacks to more than " + std::to_string(limits::csv_unpacked_times) + " times its size",
                     "see that it is the right file; if it is, unpack it by `gunzip` and name that"};
  }

  static constexpr std::size_t block = 1U << 18U;
  std::string file_;
  std::unique_ptr<gzFile_s, int (*)(gzFile)> stream_{nullptr, gzclose};
  std::string text_;  // from the line at `at_` to the end of the last block
  std::size_t at_ = 0, lines_ = 0;
  std::uint64_t unpacked_ = 0;
  bool ended_ = false;
};

std::string_view trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

/// The cells of one line; a comma inside double quotes does not separate.
void split(std::string_view line, std::vector<std::string_view>& cells) {
  cells.clear();
  bool quoted = false;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= line.size(); ++i) {
    if (i < line.size() && line[i] == '"') quoted = !quoted;
    if (i == line.size() || (line[i] == ',' && !quoted)) {
      cells.push_back(trimmed(line.substr(begin, i - begin)));
      begin = i + 1;
    }
  }
}

std::optional<double> number(std::string_view cell) {
  if (cell.empty()) return missing;
  if (cell.front() == '+') cell.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error == std::errc::result_out_of_range) return std::nullopt;
  if (error == std::errc{} && end == cell.data() + cell.size()) return value;
  std::string lower{cell};
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const std::string_view none : {"nan", "na", "n/a", "#n/a", "null", "1.#qnan", "1.#ind", "-1.#ind"})
    if (lower == none) return missing;
  return std::nullopt;
}

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

Column header(std::string_view cell, const std::string& where) {
  Column column;
  auto open = cell.rfind('[');
  if (open != std::string_view::npos && is_index(cell, open)) open = std::string_view::npos;
  column.name = std::string{trimmed(cell.substr(0, open))};
  if (open != std::string_view::npos) {
    const auto close = cell.find(']', open);
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

}  // namespace

Table Table::read(const std::filesystem::path& file, const std::vector<std::string>& text_columns) {
  Lines lines{file};
  Table table;
  table.file = file;
  std::vector<std::string_view> cells;
  std::vector<bool> is_text;
  std::string_view line;
  for (std::size_t line_number = 1; lines.next(line); ++line_number) {
    if (trimmed(line).empty()) continue;
    const auto where = [&] { return file.string() + ":" + std::to_string(line_number); };
    const auto refuse = [&](const std::string& at, const std::string& what, const std::string& mend) {
      const InputError fault{at, what,
                             mend};  // its text is the line's, which the rest of the file overwrites
      lines.check_rest();
      throw fault;
    };
    split(line, cells);
    if (table.columns.empty()) {
      if (trimmed(line).find('\r') != std::string_view::npos)
        refuse(where(), "the lines end in a carriage return alone",
               "end them in a line feed, as by `tr '\\r' '\\n'`");
      if (cells.size() == 1 && line.find_first_of(";\t") != std::string_view::npos)
        refuse(where(), "the cells are parted by semicolons or tabs",
               "part them by commas, and write decimal points");
      if (cells.size() > limits::csv_columns)
        refuse(where(), "has " + std::to_string(cells.size()) + " columns",
               "use at most " + std::to_string(limits::csv_columns));
      std::set<std::string> names;
      for (const auto cell : cells) {
        table.columns.push_back(header(cell, where()));
        if (!names.insert(table.columns.back().name).second)
          refuse(where(), "column `" + table.columns.back().name + "` stands twice", "keep one of them");
        is_text.push_back(std::find(text_columns.begin(), text_columns.end(), table.columns.back().name) !=
                          text_columns.end());
      }
      continue;
    }
    if (cells.size() != table.columns.size())
      refuse(where(),
             "this row has " + std::to_string(cells.size()) + " cells, the header " +
                 std::to_string(table.columns.size()),
             "give every row one cell a column (an empty one where a value is missing)");
    for (std::size_t i = 0; i < cells.size(); ++i) {
      Column& column = table.columns[i];
      const auto value = number(cells[i]);
      if (is_text[i]) {
        if (const auto flaw = flaw_of_label(cells[i]))
          refuse(where() + ": column `" + column.name + "`",
                 "`" + clipped(std::string{cells[i]}) + "` " + flaw->what, flaw->mend);
        column.texts.emplace_back(cells[i]);
        column.values.push_back(value.value_or(missing));
        continue;
      }
      if (!value)
        refuse(where() + ": column `" + column.name + "`", "`" + shortened(cells[i]) + "` is not a number",
               "write a number, or leave the cell empty");
      column.values.push_back(*value);
    }
  }
  for (Column& column : table.columns) column.values.shrink_to_fit();
  if (table.columns.empty())
    throw InputError{file.string(), "is empty", "begin with a header `name [unit],...`"};
  if (table.rows() == 0)
    throw InputError{file.string(), "has a header but no rows", "add the readings below it"};
  return table;
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

std::size_t Table::rows() const { return columns.empty() ? 0 : columns.front().values.size(); }
bool Table::has(std::string_view name) const { return find(name) != nullptr; }

const Column* Table::find(std::string_view name) const {
  const auto found =
      std::find_if(columns.begin(), columns.end(), [&](const Column& c) { return c.name == name; });
  return found == columns.end() ? nullptr : &*found;
}

std::vector<double> Table::in(std::string_view name, std::string_view unit) const {
  const Column* column = find(name);
  if (column == nullptr) {
    std::string have;
    for (const Column& c : columns) have += (have.empty() ? "" : ", ") + c.name;
    throw InputError{file.string(), "column `" + std::string{name} + "` is missing (there are: " + have + ")",
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
  columns.push_back({std::move(name), "", std::vector<double>(texts.size(), missing), std::move(texts)});
}

}  // namespace invar::recording
