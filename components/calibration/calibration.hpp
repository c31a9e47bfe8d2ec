// Calibration: the component that runs the measuring jobs of a cell - geometric, thermal, print - one at a time.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "components/calibration/axis_group.hpp"
#include "components/calibration/geometric_calibration.hpp"
#include "components/calibration/job_specs.hpp"
#include "components/calibration/line_laser.hpp"
#include "components/calibration/model_transaction.hpp"
#include "components/calibration/thermal_calibration.hpp"
#include "components/printing/printing.hpp"
#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/job/job_component.hpp"
#include "core/job/job_host.hpp"
#include "core/job/task.hpp"

namespace invar::calibration {

/// A job is a transaction on the compensation. Its model is put to use on trial, watched, and kept
/// only if it makes the error smaller. A job that fails, is cancelled or dies leaves the models as they were.
class Calibration final : public job::JobComponent, private job::JobHost {
 public:
  struct Parameters {
    std::int64_t axes = 2;
    double settle_timeout = 2.0;
    double velocity = 0.0;
    std::vector<GeometricJob> jobs;
    std::vector<ThermalJob> thermal_jobs;
    std::vector<printing::PrintJob> prints;
    std::vector<std::string> zones;
    void describe(auto& p) {
      p(axes, "axes", 1, 3, "how many axes the machine has");
      p(settle_timeout, "settle_timeout", "s", Range{0.01, 600.0},
        "the job fails when an axis needs longer to settle");
      p(velocity, "velocity", "m/s", Range{0.0, 10.0}, "velocity of the moves; 0: that of the stage");
      p(jobs, "jobs", "geometric calibrations that can be run");
      p(thermal_jobs, "thermal_jobs", "calibrations over position and temperature");
      p(prints, "prints", "print jobs that can be run");
      if constexpr (requires { p.node(); }) {
        std::set<std::string> names;
        job::check_names(p.node()["jobs"], jobs, names);
        job::check_names(p.node()["thermal_jobs"], thermal_jobs, names);
        job::check_names(p.node()["prints"], prints, names);
        for (const printing::PrintJob& print : prints)
          if (!print.first.empty() && std::none_of(jobs.begin(), jobs.end(),
                                                   [&](const auto& job) { return job.name == print.first; }))
            p.node()["prints"].fault("`" + print.first + "` is no job of `jobs`",
                                     "name one of them, or leave `first` out");
      }
      p(zones, "zones", "further temperatures to record: each makes a port temperature_<zone>");
    }
  };
  explicit Calibration(const Parameters& parameters);
  void activate() override;

 private:
  std::optional<Job> find(const std::string& wanted) override;
  void make_safe() override;
  void tend(bool job_runs) override;
  job::Task print(const printing::PrintJob& job);
  job::Task to_its_end(job::Task job);

  // JobHost
  job::Task enable_axes() override { return axes_.enable(); }
  job::Task move_to(Eigen::Vector3d target, job::Pace pace) override { return axes_.move_to(target, pace); }
  void tell(const std::string& text, double progress) override;
  void advance(double progress) override { progress_ = progress; }
  std::uint64_t next_id() override { return next_command_id(); }

  const Parameters& parameters_;
  job::JobHost& host_{*this};
  LineLaser laser_{*this, host_, parameters_.settle_timeout};
  ModelTransaction models_{*this, host_};
  ThermalCalibration thermal_{*this, host_, laser_, models_, parameters_.zones};
  GeometricCalibration geometric_{host_, laser_, models_};
  AxisGroup axes_{*this, host_, {parameters_.axes, parameters_.settle_timeout, parameters_.velocity}};
  std::unique_ptr<printing::Printing>
      printing_;  // only where there are print jobs: its ports must be connected
};

}  // namespace invar::calibration
