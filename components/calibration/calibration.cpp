#include "components/calibration/calibration.hpp"

#include <algorithm>
#include <utility>

namespace invar::calibration {

Calibration::Calibration(const Parameters& parameters) : parameters_{parameters} {
  if (!parameters.prints.empty()) printing_ = std::make_unique<printing::Printing>(*this, host_);
}

void Calibration::activate() {
  models_.forget();
  thermal_.forget();
  job::JobComponent::activate();
}

void Calibration::make_safe() {
  models_.abandon();
  thermal_.make_safe();
  axes_.stop();
  if (printing_) printing_->make_safe();
}

std::optional<job::JobComponent::Job> Calibration::find(const std::string& wanted) {
  if (const auto* job = job::named(parameters_.jobs, wanted))
    return Job{to_its_end(geometric_.run(*job)), job->out};
  if (const auto* job = job::named(parameters_.thermal_jobs, wanted))
    return Job{to_its_end(thermal_.run(*job)), job->out};
  if (const auto* job = job::named(parameters_.prints, wanted)) return Job{to_its_end(print(*job)), job->out};
  return std::nullopt;
}

job::Task Calibration::to_its_end(job::Task job) {
  co_await std::move(job);
  progress_ = 1.0;
  report(job::JOB_DONE, "done");
}

void Calibration::tend(bool job_runs) {
  thermal_.follow();
  if (job_runs)
    models_.watch();
  else
    laser_.drop_readings();
}

void Calibration::tell(const std::string& text, double progress) {
  progress_ = progress;
  report(job::JOB_RUNNING, text);
}

job::Task Calibration::print(const printing::PrintJob& job) {
  if (!job.first.empty()) {
    const auto first = std::find_if(parameters_.jobs.begin(), parameters_.jobs.end(),
                                    [&](const GeometricJob& other) { return other.name == job.first; });
    co_await geometric_.run(*first);
  }
  co_await printing_->run(job);
}

}  // namespace invar::calibration
