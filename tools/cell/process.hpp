// One process of a cell: its components in their executor, their ports on DDS, brought up and taken down in order.
#pragma once

#include <atomic>
#include <filesystem>
#include <string>

namespace invar::tools {

struct ProcessOptions {
  std::filesystem::path cell;
  std::string process;
  bool simulated = false;
  std::string job;  // started at time 0 where this process has the component that runs it
};

/// Runs until `stop` is set, or in simulated time until the master ends the run. Checks the whole cell first. Throws
/// InputError; returns the exit status: 0 in order, 1 a component failed to come up.
int run_process(const ProcessOptions& options, const std::atomic<bool>& stop);

}  // namespace invar::tools
