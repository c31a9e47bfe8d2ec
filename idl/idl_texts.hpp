// The IDL files as texts inside the program: recordings carry them as schemas, echo and export decode with them.
#pragma once

#include <span>
#include <string_view>

namespace invar {

struct IdlText {
  std::string_view file;  // stage, thermal, ...
  std::string_view text;  // with what it includes, without preprocessor lines
};

std::span<const IdlText> idl_texts();

}  // namespace invar
