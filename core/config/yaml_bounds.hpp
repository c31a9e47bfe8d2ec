// The bounds of a YAML text, checked before it is built in memory: size, values, depth, and what its texts hold.
#pragma once

#include <string>

namespace invar::config {

/// Walks over the text without keeping it. An alias counts with all that it stands for, so that a few lines of aliases of
/// aliases are as many values as they would unfold to. Throws InputError at the line, or YAML::Exception where it is no YAML.
void check_bounds(const std::string& text, const std::string& name);

}  // namespace invar::config
