// The words of an IDL text: names, numbers, quoted texts, signs; comments and '#' lines are left out.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace invar::recording {

struct IdlToken {
  enum class Kind : std::uint8_t { name, number, text, sign, end };
  Kind kind = Kind::end;
  std::string_view text;  // of a quoted text: what stands between the quotes
  std::size_t line = 1;
};

/// The last one is `end`. Throws InputError (`name:line`) for a comment or a quote that is not closed and for a
/// character that IDL does not know.
std::vector<IdlToken> idl_tokens(std::string_view text, const std::string& name);

}  // namespace invar::recording
