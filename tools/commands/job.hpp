// The subcommands of `invar job`, one a file.
#pragma once

#include <CLI/CLI.hpp>

namespace invar::tools {

void add_job_apply(CLI::App& job);
void add_job_compare(CLI::App& job);
/// run, list, cancel
void add_job_run(CLI::App& job);

}  // namespace invar::tools
