// A recording through the same components again: one process in simulated time, fed what it was fed, its outputs beside
// those that were recorded.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace invar::tools {

struct ReplayedTopic {
  std::string topic;
  std::uint64_t recorded = 0;    // samples of the recording that fall in the time that was replayed
  std::uint64_t equal = 0;       // the component wrote the same, value for value
  std::int64_t first_ns = -1;    // cell time of the first that differs or is missing; -1: none
  std::string first_difference;  // "position: 0.1 was recorded, 0.2 came out"
};

struct ReplayReport {
  std::vector<ReplayedTopic> outputs;
  std::vector<std::string> absent_inputs;  // connected to what the recording has nothing of
  std::uint64_t fed = 0;                   // samples given to inputs
  double simulated_seconds = 0.0;
  std::string failure;  // a component did not come up
};

/// No middleware and no other process take part. The recording must be one of simulated time (`invar run` in the file's
/// simulated time, with a recorder): there every sample has the window of time in which it was delivered. Throws
/// InputError for a faulty cell file, a process that it has not, and a recording that cannot be read.
ReplayReport replay_process(const std::filesystem::path& cell, const std::string& process,
                            const std::filesystem::path& recording, const std::function<bool()>& stop);

}  // namespace invar::tools
