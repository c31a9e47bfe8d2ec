// JobComponent: a component that runs jobs, one at a time, as commands ask, and says how far it is.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/job/task.hpp"
#include "idl/job.h"

namespace invar::job {

/// Port `job` takes commands, port `status` answers. A request that comes twice is one. A job that throws has failed; one that
/// fails, is cancelled or deactivated is made safe. Not real-time.
class JobComponent : public Component {
 public:
  void activate() override;
  void step(const Tick& tick) noexcept override;
  bool wind_down() noexcept override;
  void deactivate() noexcept override;

  /// There is a job of this name.
  [[nodiscard]] bool has(const std::string& job) { return find(job).has_value(); }

  /// Set-up: no job begins while `objection` says why not.
  void refuse_while(std::function<std::string()> objection) { objection_ = std::move(objection); }

 protected:
  struct Job {
    Task task;
    std::filesystem::path folder;  // of its files
  };
  /// The job of this name, if there is one.
  virtual std::optional<Job> find(const std::string& wanted) = 0;
  /// The job has ended before its end: everything as it was before.
  virtual void make_safe() = 0;
  /// Once a step, before the job goes on.
  virtual void tend(bool /*job_runs*/) {}

  void report(job::JobPhase phase, const std::string& text);
  /// A number for a command, never given before.
  std::uint64_t next_command_id() { return static_cast<std::uint64_t>(id) << 32U | next_command_++; }

  double progress_ = 0.0;  // the job's share that is done

 private:
  void obey(const job::JobCommand& command);
  void end(job::JobPhase phase, const std::string& text);

  Inbox<job::JobCommand> job_{*this, "job", {.optional = true, .profile = "command"}};
  Output<job::JobStatus> status_{*this, "status", "state"};
  Task task_;
  std::function<std::string()> objection_;
  job::JobStatus sample_;
  std::uint64_t next_command_ = 1;
};

}  // namespace invar::job
