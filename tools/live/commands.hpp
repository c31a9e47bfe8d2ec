// The subcommands that look at and act on a running cell, and those about this PC.
#pragma once

#include <CLI/CLI.hpp>

namespace invar::tools {

/// As those in tools/command.hpp.
void add_bridge(CLI::App& program);
void add_completion(CLI::App& program);
void add_doctor(CLI::App& program);
void add_echo(CLI::App& program);
void add_hz(CLI::App& program);
void add_latency_test(CLI::App& program);
void add_lifecycle(CLI::App& program);
void add_metrics(CLI::App& program);
void add_param(CLI::App& program);
void add_profiles(CLI::App& program);
void add_record(CLI::App& program);
void add_replay(CLI::App& program);
void add_status(CLI::App& program);
void add_top(CLI::App& program);
void add_topics(CLI::App& program);

}  // namespace invar::tools
