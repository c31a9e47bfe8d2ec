// What to tell somebody whose call of `invar` cannot be read.
#pragma once

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

namespace invar::tools {

/// Why `words` (what was typed after `invar`) are no call of `program`, and how to mend it, in one line: a subcommand or option
/// that does not exist is named with the nearest that does; any other fault in the words of `error`, the parser's.
std::string wrong_call(const CLI::App& program, const std::vector<std::string>& words,
                       const CLI::ParseError& error);

}  // namespace invar::tools
