// The IDL texts built into the program, by the types they define: what a recorder writes as schema, and what echo and
// export decode with.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/recording/idl_type.hpp"

namespace invar::recording {

struct BuiltInType {
  TypePointer type;
  std::string_view idl;  // self-contained: its file with what it includes, no preprocessor lines
};

/// Null when no IDL file of ours defines a structure of that name (a::b::T). Reads the texts at the first call; any
/// thread, not for the loop.
const BuiltInType* built_in_type(const std::string& name);

/// The names of all structures, sorted.
std::vector<std::string> built_in_type_names();

}  // namespace invar::recording
