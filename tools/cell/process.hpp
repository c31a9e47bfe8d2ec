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
  bool paced = false;  // simulated time with somebody beside it, whose commands count
  std::string job;     // started at once where this process has the component that runs it; ends with it
  std::filesystem::path outcome;  // file for what became of it, as JSON; empty: none
};

/// Runs until `stop` is set, the job has ended, or in simulated time the master ends the run. Checks the whole cell first.
/// Throws InputError. Exit status: 0 in order; 1 a component failed to come up, the job failed, or time stood still.
int run_process(const ProcessOptions& options, const std::atomic<bool>& stop);

}  // namespace invar::tools
