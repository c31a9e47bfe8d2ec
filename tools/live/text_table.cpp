#include "tools/live/text_table.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <iomanip>
#include <numeric>
#include <sstream>
#include <string_view>

#include "core/base/contract.hpp"

namespace invar::tools {

namespace {

constexpr std::size_t usual_gap = 2, least_gap = 1;
constexpr std::size_t usual_width = 80, least_width = 40;
constexpr std::size_t readable = 10;       // a text column is not made narrower while another can be
constexpr std::size_t longest_whole = 16;  // words up to this length are not broken while a gap can give way
constexpr std::size_t least_column = 4;

std::size_t longest_word(const std::string& text) {
  std::istringstream words{text};
  std::size_t most = 0;
  for (std::string word; words >> word;) most = std::max(most, word.size());
  return most;
}

/// Where to break `text`, longer than `width`: the length of the first line, and how much goes on behind it.
std::pair<std::size_t, std::size_t> break_of(std::string_view text, std::size_t width) {
  const std::size_t space = text.rfind(' ', width);
  if (space != std::string_view::npos && space > text.find_first_not_of(' ')) return {space, space + 1};
  const std::size_t sign = text.find_last_of("/._,:;=|", width - 1);
  if (sign != std::string_view::npos && sign > 0) return {sign + 1, sign + 1};
  std::size_t end = width;
  while (end > 1 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U)
    --end;  // no half letter of UTF-8
  return {end, end};
}

}  // namespace

std::size_t line_width() {
  if (const char* columns = std::getenv("COLUMNS"); columns != nullptr)
    if (const auto asked = std::strtoul(columns, nullptr, 10); asked > 0)
      return std::clamp<std::size_t>(asked, least_width, 10'000);
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0)
    return std::max<std::size_t>(size.ws_col, least_width);
  return usual_width;
}

bool is_shown_to_a_person() { return std::getenv("COLUMNS") != nullptr || isatty(STDOUT_FILENO) == 1; }

std::vector<std::string> wrapped(const std::string& text, std::size_t width) {
  std::vector<std::string> lines;
  std::string_view left = text;
  while (left.size() > width) {
    const auto [line, next] = break_of(left, width);
    lines.emplace_back(left.substr(0, line));
    left.remove_prefix(next);
  }
  lines.emplace_back(left);
  return lines;
}

void print_wrapped(const std::string& text, std::size_t indent, std::ostream& out) {
  const std::size_t width = line_width();
  std::string_view left = text;
  std::string lead;
  while (lead.size() + left.size() > width) {
    const auto [line, next] = break_of(left, width - lead.size());
    out << lead << left.substr(0, line) << '\n';
    left.remove_prefix(next);
    lead.assign(indent, ' ');
  }
  out << lead << left << '\n';
}

TextTable::TextTable(std::vector<std::string> headings) : headings_{std::move(headings)} {
  for (std::string& heading : headings_) {
    right_.push_back(heading.ends_with('>'));
    if (right_.back()) heading.pop_back();
  }
}

void TextTable::add(std::vector<std::string> cells) {
  INVAR_EXPECTS(cells.size() == headings_.size(), cells.size(), headings_.size());
  rows_.push_back(std::move(cells));
}

/// Headings give way first, then the widest texts, then the gaps, at last words. Numbers stay whole, be the line too long.
TextTable::Layout TextTable::layout_within(std::size_t width) const {
  std::vector<std::size_t> cells(headings_.size()), words, widths;
  for (std::size_t i = 0; i < headings_.size(); ++i) {
    words.push_back(longest_word(headings_[i]));
    for (const auto& row : rows_) {
      cells[i] = std::max(cells[i], row[i].size());
      words[i] = std::max(words[i], std::min(longest_word(row[i]), longest_whole));
    }
    widths.push_back(std::max(cells[i], headings_[i].size()));
  }
  std::size_t gap = usual_gap;
  const auto too_wide = [&] {
    return std::accumulate(widths.begin(), widths.end(), gap * (widths.size() - 1)) > width;
  };
  if (!too_wide()) return {widths, gap};
  for (std::size_t i = 0; i < widths.size(); ++i) widths[i] = std::max(cells[i], longest_word(headings_[i]));
  const auto narrow = [&](auto least) {
    while (too_wide()) {
      std::size_t widest = widths.size();
      for (std::size_t i = 0; i < widths.size(); ++i)
        if (!right_[i] && widths[i] > least(i) && (widest == widths.size() || widths[i] > widths[widest]))
          widest = i;
      if (widest == widths.size()) return;
      --widths[widest];
    }
  };
  narrow([&](std::size_t i) { return std::max(readable, words[i]); });
  narrow([&](std::size_t i) { return words[i]; });
  if (too_wide()) gap = least_gap;
  narrow([](std::size_t) { return least_column; });
  return {widths, gap};
}

void TextTable::print_row(const Row& row, const Layout& layout, std::ostream& out) const {
  const auto& [widths, gap] = layout;
  std::vector<std::vector<std::string>> lines;
  std::size_t most = 1;
  for (std::size_t i = 0; i < row.size(); ++i) {
    lines.push_back(wrapped(row[i], std::max<std::size_t>(widths[i], 1)));
    most = std::max(most, lines.back().size());
  }
  for (std::size_t k = 0; k < most; ++k) {
    std::string text;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string cell = k < lines[i].size() ? lines[i][k] : "";
      const std::string space(widths[i] - cell.size(), ' ');
      text += (i == 0 ? "" : std::string(gap, ' ')) + (right_[i] ? space + cell : cell + space);
    }
    text.erase(text.find_last_not_of(' ') + 1);
    out << text << '\n';
  }
}

void TextTable::print(std::ostream& out, std::size_t width) const {
  const Layout layout = layout_within(width);
  print_row(headings_, layout, out);
  for (const Row& row : rows_) print_row(row, layout, out);
}

std::string number_text(double value, int digits) {
  std::ostringstream text;
  text << std::setprecision(digits) << value;
  return text.str();
}

std::string microseconds_text(std::int64_t ns) {
  const double value = static_cast<double>(ns) * 1e-3;
  std::ostringstream text;
  text << std::fixed << std::setprecision(value < 100.0 ? 1 : 0) << value;
  return text.str();
}

}  // namespace invar::tools
