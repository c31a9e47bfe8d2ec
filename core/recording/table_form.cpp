#include "core/recording/table_form.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

#include "core/base/fault.hpp"
#include "core/recording/time_stamp.hpp"

namespace invar::recording {

namespace {

/// What may part cells. Of two that part a file alike the table is ambiguous; blanks count where none of the others do.
struct Separator {
  char mark;
  const char* words;
};
constexpr std::array separators{Separator{',', "commas"}, Separator{';', "semicolons"},
                                Separator{'\t', "tabs"}, Separator{'|', "bars"}, Separator{' ', "blanks"}};
constexpr std::array<std::string_view, 3> comment_marks{"#", "%", "//"};
constexpr std::array<std::string_view, 8> no_numbers{"nan",  "na",      "n/a",    "#n/a",
                                                     "null", "1.#qnan", "1.#ind", "-1.#ind"};

std::string lower_case(std::string_view text) {
  std::string lower{text};
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  return lower;
}

/// Of a number: the digits of a double, its sign and its exponent are far fewer.
constexpr std::size_t longest_number = 64;

/// Up to three digits, the first no zero, then a comma and three more: 1,234.
bool may_be_thousands(std::string_view cell, std::size_t comma) {
  const auto digits = cell.substr(cell.front() == '-' ? 1 : 0);
  const auto before = comma - (cell.size() - digits.size());
  return cell.size() == comma + 4 && before >= 1 && before <= 3 && digits.front() != '0';
}

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

/// A number or a time, in whichever form.
bool is_reading(std::string_view cell) {
  NumberCells fresh;
  return fresh.read(cell).has_value() || parse_time_stamp(cell).has_value();
}

bool are_readings(const std::vector<std::string_view>& cells) {
  return std::all_of(cells.begin(), cells.end(), is_reading) &&
         std::any_of(cells.begin(), cells.end(), [](std::string_view cell) { return !cell.empty(); });
}

void split_at_blanks(std::string_view line, std::vector<std::string_view>& cells) {
  bool quoted = false;
  int depth = 0;  // within brackets: `t [N m]` is one cell, and so are `t` and the bracket behind it
  std::size_t begin = std::string_view::npos;
  const auto opens = [&](std::size_t i) { return i < line.size() && (line[i] == '[' || line[i] == '('); };
  for (std::size_t i = 0; i <= line.size(); ++i) {
    const bool at_end = i == line.size();
    if (!at_end && line[i] == '"') quoted = !quoted;
    if (opens(i)) ++depth;
    if (!at_end && (line[i] == ']' || line[i] == ')')) --depth;
    if (!at_end && (quoted || depth > 0 || !is_blank(line[i]))) {
      if (begin == std::string_view::npos) begin = i;
      continue;
    }
    if (begin == std::string_view::npos) continue;
    auto next = i;
    while (next < line.size() && is_blank(line[next])) ++next;
    if (opens(next)) continue;
    cells.push_back(trimmed(line.substr(begin, i - begin)));
    begin = std::string_view::npos;
  }
}

/// How well a separator fits the first lines: rows with as many cells as the first line, then cells that are readings.
struct Fit {
  std::size_t rows = 0, readings = 0;
  bool possible = false;
};

Fit fit_of(char separator, const std::vector<NumberedLine>& sample) {
  Fit fit;
  TableForm form;
  form.separator = separator;
  std::vector<std::string_view> cells;
  form.split(sample.front().text, cells);
  const std::size_t columns = cells.size() - (cells.size() > 2 && cells.back().empty() ? 1U : 0U);
  fit.possible = columns > 1;
  for (const auto& line : sample) {
    form.split(line.text, cells, columns);
    if (cells.size() == columns && &line != &sample.front()) ++fit.rows;
    fit.readings += static_cast<std::size_t>(std::count_if(cells.begin(), cells.end(), is_reading));
  }
  return fit;
}

char separator_of(const std::vector<NumberedLine>& sample, const std::filesystem::path& file) {
  const Separator* best = nullptr;
  const Separator* rival = nullptr;
  Fit most;
  for (const auto& one : separators) {
    const auto fit = fit_of(one.mark, sample);
    if (!fit.possible || (one.mark == ' ' && (fit.rows == 0 || most.rows > 0))) continue;
    const bool better =
        best == nullptr || fit.rows > most.rows || (fit.rows == most.rows && fit.readings > most.readings);
    if (!better && fit.rows == most.rows && fit.readings == most.readings && fit.rows > 0) rival = &one;
    if (better) best = &one, most = fit, rival = nullptr;
  }
  if (rival != nullptr)
    throw InputError{file.string() + ":" + std::to_string(sample.front().number),
                     std::string{"the cells may be parted by "} + best->words + " or by " + rival->words,
                     "put texts that hold one of them into double quotes"};
  return best == nullptr ? ',' : best->mark;
}

/// A comment that names each column, as numpy writes a header; the rows below it are numbers alone.
std::optional<NumberedLine> header_in(const std::optional<NumberedLine>& comment, const TableForm& form,
                                      std::size_t columns) {
  if (!comment || columns < 2) return std::nullopt;
  auto text = trimmed(comment->text);
  for (const auto mark : comment_marks)
    if (text.starts_with(mark)) {
      text.remove_prefix(mark.size());
      break;
    }
  std::vector<std::string_view> cells;
  form.split(trimmed(text), cells);
  std::vector<std::string_view> names = cells;
  std::sort(names.begin(), names.end());
  const bool is_header = cells.size() == columns && std::none_of(cells.begin(), cells.end(), is_reading) &&
                         std::adjacent_find(names.begin(), names.end()) == names.end();
  return is_header ? std::optional{NumberedLine{comment->number, std::string{trimmed(text)}}} : std::nullopt;
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

bool is_comment(std::string_view line) {
  while (!line.empty() && is_blank(line.front())) line.remove_prefix(1);
  return std::any_of(comment_marks.begin(), comment_marks.end(),
                     [&](std::string_view mark) { return line.starts_with(mark); });
}

void TableForm::split(std::string_view line, std::vector<std::string_view>& cells,
                      std::size_t expected) const {
  cells.clear();
  if (separator == ' ') {
    split_at_blanks(line, cells);
    return;
  }
  bool quoted = false;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= line.size(); ++i) {
    if (i < line.size() && line[i] == '"') quoted = !quoted;
    if (i == line.size() || (line[i] == separator && !quoted)) {
      cells.push_back(trimmed(line.substr(begin, i - begin)));
      begin = i + 1;
    }
  }
  if (expected > 0 && cells.size() == expected + 1 && cells.back().empty()) cells.pop_back();
}

TableForm form_of(const std::vector<NumberedLine>& sample, const std::optional<NumberedLine>& comment,
                  const std::filesystem::path& file) {
  TableForm form;
  form.separator = separator_of(sample, file);
  std::vector<std::string_view> cells;
  form.split(sample.front().text, cells);
  form.header_is_row = !are_readings(cells);
  form.header = form.header_is_row ? std::optional{sample.front()} : header_in(comment, form, cells.size());
  return form;
}

std::optional<double> NumberCells::read(std::string_view cell) {
  if (cell.empty()) return no_number;
  if (cell.front() == '+') cell.remove_prefix(1);
  const auto whole = [](std::string_view text) -> std::optional<double> {
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size() ? std::optional{value} : std::nullopt;
  };
  if (const auto value = whole(cell)) {
    if (mark_ == '.' || cell.find('.') == std::string_view::npos) return value;
    if (mark_ == ',') return std::nullopt;
    mark_ = '.';
    return value;
  }
  const auto comma = cell.find(',');
  if (comma != std::string_view::npos && mark_ != '.' && cell.size() < longest_number) {
    std::string point{cell};
    point[comma] = '.';
    const auto value = cell.find('.') == std::string_view::npos ? whole(point) : std::nullopt;
    if (!value || (commas_part_ && mark_ == 0 && may_be_thousands(cell, comma))) return std::nullopt;
    mark_ = ',';
    return value;
  }
  const auto lower = lower_case(cell.substr(0, longest_number));
  if (std::find(no_numbers.begin(), no_numbers.end(), lower) != no_numbers.end()) return no_number;
  return std::nullopt;
}

std::string NumberCells::flaw(std::string_view cell) const {
  NumberCells fresh;
  const bool is_number = fresh.read(cell).has_value();
  if (is_number && mark_ == '.') return "has a decimal comma, and a number before it a decimal point";
  if (is_number && mark_ == ',') return "has a decimal point, and a number before it a decimal comma";
  if (is_number) return "may have a decimal comma or one that parts thousands";
  return "is not a number";
}

}  // namespace invar::recording
