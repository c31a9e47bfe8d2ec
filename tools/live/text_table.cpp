#include "tools/live/text_table.hpp"

#include <algorithm>
#include <iomanip>
#include <sstream>

#include "core/base/contract.hpp"

namespace invar::tools {

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

void TextTable::print(std::ostream& out) const {
  std::vector<std::size_t> widths;
  for (std::size_t i = 0; i < headings_.size(); ++i) {
    widths.push_back(headings_[i].size());
    for (const auto& row : rows_) widths[i] = std::max(widths[i], row[i].size());
  }
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const std::string space(widths[i] - cells[i].size(), ' ');
      text += (i == 0 ? "" : "  ") + (right_[i] ? space + cells[i] : cells[i] + space);
    }
    text.erase(text.find_last_not_of(' ') + 1);
    out << text << '\n';
  };
  line(headings_);
  for (const auto& row : rows_) line(row);
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
