#include "core/job/job_component.hpp"

#include <exception>
#include <utility>

#include "core/base/folder.hpp"

namespace invar::job {

void JobComponent::activate() {
  task_ = {};
  report(job::JOB_IDLE, "ready");
}

/// Who commands motion ends before what moves does, so that nobody has to refuse it.
bool JobComponent::wind_down() noexcept {
  if (task_.running()) end(job::JOB_CANCELLED, "it was told to come to rest");
  return true;
}

void JobComponent::deactivate() noexcept {
  if (task_.running()) end(job::JOB_CANCELLED, "the component was deactivated");
}

void JobComponent::end(job::JobPhase phase, const std::string& text) {
  task_ = {};
  make_safe();
  report(phase, text);
}

void JobComponent::report(job::JobPhase phase, const std::string& text) {
  stamp(sample_);
  sample_.component_id(id);
  sample_.phase(phase);
  sample_.progress(progress_);
  sample_.text(text);
  status_.write(sample_);
}

void JobComponent::obey(const job::JobCommand& command) {
  if (command.kind() == job::JOB_CANCEL) {
    if (task_.running()) end(job::JOB_CANCELLED, "cancelled");
    return;
  }
  if (command.id() == sample_.id() && sample_.id() != 0) return;  // the same request again
  if (task_.running()) {
    report(job::JOB_RUNNING, "job `" + std::string{sample_.name().c_str()} + "` is running; cancel it first");
    return;
  }
  const std::string wanted{command.name().c_str()};
  sample_.id(command.id());
  sample_.name(wanted);
  sample_.result_path("");
  progress_ = 0.0;
  std::optional<Job> job = find(wanted);
  if (!job) {
    report(job::JOB_FAILED, "`" + wanted + "` is no job of this component");
    return;
  }
  // Who gives a value means it: a job that runs without it would move as nobody asked.
  if (command.arguments().size() > 0) {
    report(job::JOB_FAILED,
           "job `" + wanted + "` takes no arguments; leave them out, or change the cell file");
    return;
  }
  if (const std::string why = objection_ ? objection_() : ""; !why.empty())
    return report(job::JOB_FAILED, "job `" + wanted + "` is refused: " + why);
  make_folder(job->folder);
  sample_.result_path(std::filesystem::absolute(job->folder).string());
  task_ = std::move(job->task);
  report(job::JOB_RUNNING, "started");
}

void JobComponent::step(const Tick&) noexcept {
  try {
    job::JobCommand command;
    while (job_.take(command)) obey(command);
    tend(task_.running());
    if (task_.running()) task_.resume();
  } catch (const std::exception& error) {
    end(job::JOB_FAILED, error.what());
  }
}

}  // namespace invar::job
