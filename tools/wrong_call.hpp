// The message for a call of `invar` that cannot be read.
#pragma once

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

namespace invar::tools {

/// Why `words` (typed after `invar`) are no call of `program`, and how to mend the call, in one line. A subcommand or option
/// that does not exist is named with the nearest that does. Any other fault is told in the words of `error`, the parser's.
std::string wrong_call(const CLI::App& program, const std::vector<std::string>& words,
                       const CLI::ParseError& error);

}  // namespace invar::tools
