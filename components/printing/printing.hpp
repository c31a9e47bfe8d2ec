// Printing: the print job - calibrates the camera, prints, measures, identifies, compensates, prints again.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/job/job_host.hpp"
#include "core/job/job_spec.hpp"
#include "core/metrology/droplet/droplet_trajectory.hpp"
#include "core/metrology/droplet/trajectory_tracker.hpp"
#include "idl/compensation.h"
#include "idl/dispensing.h"
#include "idl/image.h"

namespace invar::printing {

/// More prints after the calibration, while the head drifts: each is measured, and the model follows.
struct DriftWatch {
  std::int64_t prints = 0;
  double pause = 0.0;
  double placement = 2e-7;
  double slowness = 1e-3;
  double limit = 1e-4;
  void describe(auto& p) {
    p(prints, "prints", 0, 10'000, "at the largest height, the model updated after each");
    p(pause, "pause", "s", Range{0.0, 1e5}, "between two of them");
    p(placement, "placement", "m", Range{0.0, 1e-3}, "1 sigma that the placement error wanders in a second");
    p(slowness, "slowness", "1", Range{0.0, 1.0}, "share of the time of flight that wanders in a second");
    p(limit, "limit", "m", Range{1e-9, 1e-2},
      "the job fails when the landing has moved farther: clean the nozzle");
  }
};

struct PrintJob : job::JobSpec {
  std::string first;
  std::string pattern;
  std::vector<double> heights{2e-3, 20e-3};
  std::vector<double> ruler;
  double velocity = 0.05;
  double acceleration = 2.0;
  double jerk = 60.0;
  double reach = 9e-4;
  DriftWatch drift;
  void describe(auto& p) {
    job::JobSpec::describe(p);
    p(first, "first", "a job of `jobs` that is done before");
    p(pattern, "pattern", "pattern of the dispenser, printed at each height");
    p(heights, "heights", "m", "from nozzle to substrate, in the order of printing");
    p(ruler, "ruler", "m",
      "[x, y] of the middle of the camera's ruler in the machine; none: the camera is not calibrated");
    p(velocity, "velocity", "m/s", Range{1e-4, 1.0}, "along the rows");
    p(acceleration, "acceleration", "m/s2", Range{1e-2, 100.0}, "along the rows");
    p(jerk, "jerk", "m/s3", Range{1e-1, 1e5}, "along the rows");
    p(reach, "reach", "m", Range{1e-6, 1e-1},
      "a droplet lies within this of its target, or it is none of this pattern");
    p(drift, "drift", "prints after the calibration");
    if constexpr (requires { p.node(); }) {
      for (const double height : heights)
        if (!(height > 0.0))
          p.node()["heights"].fault("a height is not positive", "give distances from the nozzle down");
      if (heights.empty())
        p.node()["heights"].fault("is empty",
                                  "give two heights, so that tilt and placement can be told apart");
      if (!ruler.empty() && ruler.size() != 2) p.node()["ruler"].fault("needs two numbers", "write [x, y]");
    }
  }
};

/// Owns the ports of the job, on behalf of the component that runs it.
class Printing {
 public:
  Printing(Component& owner, job::JobHost& host);
  /// Files into job.out: droplets.csv (before), compensation.yaml, droplets_after.csv, drift.csv, and a picture a print.
  /// Throws std::runtime_error and InputError with what a user can mend; the model is rolled back when it does not help.
  job::Task run(const PrintJob& job);
  /// Pressure off, valve disarmed.
  void make_safe();

 private:
  /// One droplet, from its trigger to the camera.
  struct Print {
    std::uint64_t droplet = 0;
    Eigen::Vector2d target, jetted, velocity, landed;
    double height = 0.0, diameter = 0.0, time = 0.0;
  };
  using Prints = std::vector<Print>;
  using Condition = std::function<bool()>;

  job::Task wait_for(const Condition& done, double seconds, std::string what);
  job::Task pressurise();
  job::Task calibrate_camera(Eigen::Vector2d ruler);
  job::Task print(const PrintJob& job, double height, std::string picture, Prints& prints);
  job::Task drive_rows(const PrintJob& job, const dispensing::TriggerPattern& pattern);
  job::Task measure(const PrintJob& job, std::string picture, Prints& prints);
  job::Task change_model(compensation::ModelCommandKind kind, std::string path);
  job::Task use(const metrology::DropletTrajectory& trajectory, std::filesystem::path source,
                std::filesystem::path file);
  job::Task watch_drift(const PrintJob& job, const metrology::TrajectoryFit& fit);
  void trigger(dispensing::TriggerCommandKind kind, std::uint64_t pattern_id);
  template <class Sample>
  Sample stamped() const;

  Component& owner_;
  job::JobHost& host_;
  Output<dispensing::PressureCommand> pressure_command_;
  Input<dispensing::PressureState> pressure_;
  Output<dispensing::PatternCommand> print_;
  Inbox<dispensing::TriggerPattern> pattern_;
  Output<dispensing::TriggerCommand> trigger_;
  Input<dispensing::ValveState> valve_;
  Inbox<dispensing::DropletJetted> jetted_;
  Inbox<dispensing::DropletRefused> refused_;
  Output<dispensing::SubstrateCommand> lay_;
  Input<dispensing::SubstrateState> substrate_;
  Output<compensation::ModelCommand> aim_;
  Input<compensation::ModelStatus> aim_status_;
  Output<image::VisionCommand> look_;
  Input<image::VisionStatus> vision_;
  Inbox<image::DropletsMeasured> droplets_;
  std::uint64_t last_command_ = 0;
  double share_ = 0.0;  // of the whole job, of one print
  double progress_ = 0.0;
  Instant begun_;
};

}  // namespace invar::printing
