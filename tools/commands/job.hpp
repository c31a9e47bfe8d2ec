// The subcommands of `invar job`, one a file.
#pragma once

#include <CLI/CLI.hpp>

namespace invar::tools {

void add_job_compare(CLI::App& job);

}  // namespace invar::tools
