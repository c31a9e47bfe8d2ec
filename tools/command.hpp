// A subcommand of `invar`: one file in tools/commands/ defines one of these; tools/main.cpp lists them.
#pragma once

#include <CLI/CLI.hpp>

namespace invar::tools {

/// Each adds its subcommand (options, help with an example, callback) to the program. Callbacks throw
/// InputError for what the user must mend (exit 2) and CLI::RuntimeError(status) to end with another status.
void add_about(CLI::App& program);
void add_backup(CLI::App& program);
void add_calibrate(CLI::App& program);
void add_check(CLI::App& program);
void add_export(CLI::App& program);
void add_job(CLI::App& program);
void add_keys(CLI::App& program);
void add_measure(CLI::App& program);
void add_new(CLI::App& program);
void add_predict(CLI::App& program);
void add_restore(CLI::App& program);
void add_run(CLI::App& program);
void add_recording(CLI::App& program);
void add_simulate(CLI::App& program);
void add_deploy(CLI::App& program);
void add_diagnose(CLI::App& program);
void add_types(CLI::App& program);
void add_units(CLI::App& program);

}  // namespace invar::tools
