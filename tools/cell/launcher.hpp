// Launcher: starts the processes of a cell that belong to this PC, keeps simulated time, stops them in a safe order.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace invar::tools {

struct LaunchOptions {
  std::filesystem::path cell;
  std::string host;               // only processes of this host; empty: all that have an address of this PC
  std::optional<bool> simulated;  // otherwise what the cell file says
  std::string job;                // run it, then stop
  double duration = 0.0;          // s of the cell's time; 0: until stopped
  double pace =
      0.0;  // simulated time runs no faster than so many times the wall clock; 0: as fast as it goes
  bool quiet = false;  // nothing on the error output but what is wrong
  /// Set by the caller: processes of a secured cell whose certificate on the disk is newer than they are started anew, one after
  /// the other, each brought to rest before. Null: never.
  std::atomic<bool>* renew = nullptr;
  /// Called as the job goes on: how much of it is done (0 to 1), and what it does now.
  std::function<void(double fraction, const std::string& text)> progress;
};

struct ProcessOutcome {
  std::string process;
  int status = 0;      // of its end
  std::string report;  // JSON that it left; may be empty
};

struct LaunchOutcome {
  std::vector<ProcessOutcome> processes;
  double wall_seconds = 0.0;
  double start_seconds = 0.0;  // until every process was there
  bool simulated = false;
  std::string failure;  // empty: in order
};

/// Runs until the job has ended, `stop` is set, the time is over or a process ended by itself. Without a job, a process that
/// was killed or failed is started again. To stop, all that moves comes to rest first, in every process. Then the processes stop
/// in the order of the cell file, each with its components downstream first. The file names moving processes first, the recorder last.
LaunchOutcome launch(const LaunchOptions& options, const std::atomic<bool>& stop);

}  // namespace invar::tools
