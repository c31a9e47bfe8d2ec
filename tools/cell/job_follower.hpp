// JobFollower: starts the job that a process was told to run, and knows how far it is and how it ended.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>

#include "core/component/component.hpp"
#include "idl/job.h"

namespace invar::tools {

/// Any thread, once it follows.
class JobFollower {
 public:
  /// Set-up. `component`: the one that the cell file names for `job`; throws std::invalid_argument where it runs no jobs.
  void follow(Component& component, const std::string& job);
  /// Gives the command to the component, which is active by then. Nothing without a job.
  void start() const {
    if (start_) start_();
  }

  [[nodiscard]] bool runs() const { return static_cast<bool>(start_); }
  [[nodiscard]] bool has_ended() const { return ended_; }
  /// It has not failed and was not cancelled; also where there is none.
  [[nodiscard]] bool is_well() const;
  /// The newest that it said.
  [[nodiscard]] job::JobStatus status() const;
  /// name, done, text, result, seconds.
  [[nodiscard]] nlohmann::json outcome() const;

 private:
  void take(const job::JobStatus& sample);

  std::function<void()> start_;
  std::atomic<bool> ended_{false};
  mutable std::mutex mutex_;
  job::JobStatus status_;
  std::int64_t began_ns_ = 0;
};

}  // namespace invar::tools
