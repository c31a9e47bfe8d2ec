// One process of a cell: its components in their executor, their ports on DDS, brought up and taken down in order.
#pragma once

#include <sys/types.h>

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
  pid_t launcher = 0;             // who started it, and may have ended before it can ask; 0: its parent
  std::uint32_t restarts = 0;     // how often `launcher` started it again
  std::string last_end;           // how its last life ended
};

/// Requests of others to a process; signal handlers may set both.
struct ProcessOrders {
  std::atomic<bool> stop{false};
  std::atomic<bool> rest{false};  // by the clock: what moves comes to rest; all goes on until `stop`
  /// Certificates were renewed. `invar run` starts anew whom it concerns; a process of it hands over to standbys, then rests.
  std::atomic<bool> renew{false};
};

/// Runs until `stop` is set, the job has ended, or in simulated time the master ends the run. Checks the whole cell first. One
/// that `invar run` started (it has an outcome file) comes to rest and stops, too, when that is no more.
/// Throws InputError. Exit status: 0 in order; 1 a component failed to come up, the job failed, time stood still, or, without a launcher
/// that reads its outcome, something was wrong at the end.
int run_process(const ProcessOptions& options, const ProcessOrders& orders);

}  // namespace invar::tools
