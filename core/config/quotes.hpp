// Quotes of YAML: a text within them, and those that somebody forgot to close, where yaml-cpp takes the rest of the file.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace invar::config {

/// The quoted text from `begin`, the place of the opening quote, on.
struct Quoted {
  bool closed = false;
  bool swallows_keys = false;  // a line within it begins like `key: value`
  std::size_t end = 0;         // behind the closing quote, or the end of the text
};
[[nodiscard]] Quoted quoted(std::string_view text, std::size_t begin);

/// The line (from 1) of the first quote that opens and is not closed on its line; for text that is no YAML.
[[nodiscard]] std::optional<int> open_quote(std::string_view text);

/// A text as a YAML scalar in double quotes, which nothing in it can leave; control characters become their escapes as letters.
[[nodiscard]] std::string in_quotes(std::string_view text);

}  // namespace invar::config
