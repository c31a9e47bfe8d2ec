// Options of commands that reach the PCs of a cell by ssh.
#pragma once

#include <CLI/CLI.hpp>

#include "tools/deploy/deployment.hpp"

namespace invar::tools {

/// --prefix, --user, --identity, --ssh-config, --ssh-port.
void add_remote_options(CLI::App& command, DeployOptions& options);

/// Their letters stand in scripts and units of the PCs. Throws InputError.
void check_remote_options(const DeployOptions& options);

}  // namespace invar::tools
