// Files that a process leaves for its launcher: how far its job is, that it rests, at the end its outcome.
#pragma once

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "core/base/time.hpp"
#include "core/executor/process_control.hpp"

namespace invar::tools {

/// Where the process that leaves `outcome` says how far its job is.
[[nodiscard]] std::filesystem::path progress_file(const std::filesystem::path& outcome);

/// There once the process that leaves `outcome` moves nothing any more, as it was ordered.
[[nodiscard]] std::filesystem::path rest_file(const std::filesystem::path& outcome);

/// The file is there as a whole or not at all: a full disk, or a folder that somebody cleared away, stops no cell.
void write_whole(const std::filesystem::path& file, const nlohmann::json& json) noexcept;

/// How the loop did: cycles, what was late, what real time was not granted.
[[nodiscard]] nlohmann::json loop_outcome(const ProcessStatus& status, Duration period);

/// Writes how far a job is, ten times a second at most.
class ProgressFile {
 public:
  /// Without an outcome nobody looks, and nothing is written.
  explicit ProgressFile(const std::filesystem::path& outcome);
  void leave(double fraction, const std::string& text);

 private:
  std::filesystem::path file_;
  std::chrono::steady_clock::time_point left_;
  double fraction_ = -1.0;
  std::string text_;
};

}  // namespace invar::tools
