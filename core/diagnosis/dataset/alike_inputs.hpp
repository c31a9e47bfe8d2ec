// Inputs that run alike: what goes with the one goes with the other, and a recording does not say which of them it is.
#pragma once

#include <cstddef>
#include <string>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// How many other inputs of the user's own equations run like the input `symbol`, by Pearson's correlation over all rows.
/// 0 where `symbol` is no input.
std::size_t inputs_like(const Case& data, const std::string& symbol);

}  // namespace invar::diagnosis
