#include "core/config/quotes.hpp"

#include <algorithm>
#include <cctype>

#include "core/base/name.hpp"

namespace invar::config {

namespace {

bool begins_like_a_key(std::string_view line) {
  const auto first = line.find_first_not_of(" -");
  if (first == std::string_view::npos) return false;
  line.remove_prefix(first);
  const auto colon = std::find_if_not(
      line.begin(), line.end(), [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; });
  if (colon == line.begin() || colon == line.end() || *colon != ':') return false;
  const auto next = colon + 1;
  return next == line.end() || *next == ' ' || *next == '\r';
}

}  // namespace

Quoted quoted(std::string_view text, std::size_t begin) {
  const char quote = text[begin];
  Quoted result{false, false, text.size()};
  for (std::size_t i = begin + 1; i < text.size(); ++i) {
    if (quote == '"' && text[i] == '\\') {
      ++i;
    } else if (quote == '\'' && text[i] == quote && i + 1 < text.size() && text[i + 1] == quote) {
      ++i;
    } else if (text[i] == quote) {
      result.closed = true;
      result.end = i + 1;
      break;
    } else if (text[i] == '\n') {
      const auto line = text.substr(i + 1);
      result.swallows_keys |= begins_like_a_key(line.substr(0, line.find('\n')));
    }
  }
  return result;
}

std::optional<int> open_quote(std::string_view text) {
  int line = 1;
  char before = '\n';  // the last letter that is no space, or '\n'
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    const bool apart = i == 0 || std::isspace(static_cast<unsigned char>(text[i - 1])) != 0;
    if (c == '#' && apart) {
      i = std::min(text.find('\n', i), text.size()) - 1;
    } else if ((c == '"' || c == '\'') &&
               std::string_view{":[{,-\n"}.find(before) != std::string_view::npos) {
      const Quoted found = quoted(text, i);
      if (!found.closed || text.substr(i, found.end - i).find('\n') != std::string_view::npos) return line;
      i = found.end - 1;
      before = c;
    } else if (c == '\n') {
      ++line;
      before = c;
    } else if (c != ' ') {
      before = c;
    }
  }
  return std::nullopt;
}

std::string in_quotes(std::string_view text) {
  std::string out = "\"";
  for (const char c : printable(text)) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

}  // namespace invar::config
