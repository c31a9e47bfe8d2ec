#include "tools/cell/job_follower.hpp"

#include <stdexcept>

#include "core/component/port.hpp"

namespace invar::tools {

void JobFollower::follow(Component& component, const std::string& job) {
  auto* inbox = dynamic_cast<Inbox<job::JobCommand>*>(component.find_port("job"));
  auto* status = dynamic_cast<Output<job::JobStatus>*>(component.find_port("status"));
  if (inbox == nullptr || status == nullptr)
    throw std::invalid_argument{"`" + component.name + "` runs no jobs"};
  status->add_sink([this](const job::JobStatus& sample, Instant) { take(sample); });
  job::JobCommand command;
  command.cell(component.cell);
  command.id(1);
  command.kind(job::JOB_RUN);
  command.name(job);
  start_ = [lane = inbox->add_lane(), command] { lane(command, Instant{0}); };
}

void JobFollower::take(const job::JobStatus& sample) {
  const std::scoped_lock lock{mutex_};
  if (sample.phase() == job::JOB_RUNNING && status_.phase() != job::JOB_RUNNING)
    began_ns_ = sample.at().time_ns();
  status_ = sample;
  ended_ = sample.phase() == job::JOB_DONE || sample.phase() == job::JOB_FAILED ||
           sample.phase() == job::JOB_CANCELLED;
}

bool JobFollower::is_well() const {
  const std::scoped_lock lock{mutex_};
  return !runs() || !ended_ || status_.phase() == job::JOB_DONE;
}

job::JobStatus JobFollower::status() const {
  const std::scoped_lock lock{mutex_};
  return status_;
}

nlohmann::json JobFollower::outcome() const {
  const std::scoped_lock lock{mutex_};
  return {{"name", status_.name().c_str()},
          {"done", status_.phase() == job::JOB_DONE},
          {"text", status_.text().c_str()},
          {"result", status_.result_path().c_str()},
          {"seconds", static_cast<double>(status_.at().time_ns() - began_ns_) * 1e-9}};
}

}  // namespace invar::tools
