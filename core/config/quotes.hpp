// Quotes that somebody forgot to close: yaml-cpp takes the rest of the file as text, or stops far below.
#pragma once

#include <optional>
#include <string_view>

namespace invar::config {

/// What stands in quotes from `begin`, the place of the opening quote, on.
struct Quoted {
  bool closed = false;
  bool swallows_keys = false;  // a line within it begins like `key: value`
  std::size_t end = 0;         // behind the closing quote, or the end of the text
};
[[nodiscard]] Quoted quoted(std::string_view text, std::size_t begin);

/// The line (from 1) of the first quote that opens and is not closed on its line; for text that is no YAML.
[[nodiscard]] std::optional<int> open_quote(std::string_view text);

}  // namespace invar::config
