// AxisTrial: runs of one axis that say how well it follows - force ripple identified and fed forward, sinusoids tracked.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "components/calibration/axis_runner.hpp"
#include "components/calibration/job_specs.hpp"
#include "core/component/component.hpp"
#include "core/component/parameters.hpp"

namespace invar::calibration {

/// Slow runs forth and back, the ripple identified from current and position, given to the stage, and faster runs that were
/// not fitted before and after.
struct RippleJob : job::JobSpec {
  std::filesystem::path model;
  double from = 0.0;
  double to = 0.0;
  double velocity = 0.02;
  double verify_velocity = 0.03;
  std::int64_t passes = 2;
  void describe(auto& p) {
    job::JobSpec::describe(p);
    p(model, "model", "model.yaml of the axis without ripple");
    p(from, "from", "m", Range{-10.0, 10.0}, "one end of the runs");
    p(to, "to", "m", Range{-10.0, 10.0}, "the other end");
    p(velocity, "velocity", "m/s", Range{1e-4, 1.0}, "velocity of the runs to identify from");
    p(verify_velocity, "verify_velocity", "m/s", Range{1e-4, 1.0}, "velocity of the runs before and after");
    p(passes, "passes", 1, 100, "forth and back so often");
  }
};

/// Sinusoids, followed by the servo and watched by the laser.
struct TrackingJob : job::JobSpec {
  double from = 0.0;
  double amplitude = 0.1;
  std::vector<double> periods{3.0, 4.0, 5.0, 1.05};
  std::int64_t cycles = 2;
  void describe(auto& p) {
    job::JobSpec::describe(p);
    p(from, "from", "m", Range{-10.0, 10.0}, "where the sinusoids begin: their lower end");
    p(amplitude, "amplitude", "m", Range{-1.0, 1.0}, "half of the way");
    p(periods, "periods", "s", Range{1e-2, 1e4}, "one sinusoid each");
    p(cycles, "cycles", 1, 1000, "periods of each");
  }
};

/// Forth and back at several speeds, the same each time: what a diagnosis records, and what tells whether it was right.
/// With `apply`, once more after that model was given to the stage - unless it says nothing that `model` does not.
struct MotionJob : job::JobSpec {
  double from = 0.0;
  double to = 0.0;
  std::vector<double> velocities{0.02, 0.05, 0.1};
  std::int64_t passes = 1;
  std::filesystem::path model;
  std::string apply;
  void describe(auto& p) {
    job::JobSpec::describe(p);
    p(from, "from", "m", Range{-10.0, 10.0}, "one end of the runs");
    p(to, "to", "m", Range{-10.0, 10.0}, "the other end");
    p(velocities, "velocities", "m/s", Range{1e-4, 10.0}, "one after the other");
    p(passes, "passes", 1, 100, "forth and back so often, at each velocity");
    p(model, "model", "with apply: model.yaml of the axis as it was believed to be");
    p(apply, "apply", "model.yaml that `invar diagnose` writes; relative to where the cell was started");
  }
};

/// One axis; `model` is its stage's.
class AxisTrial final : public AxisRunner {
 public:
  struct Parameters {
    std::int64_t axis = 0;
    std::vector<RippleJob> ripple;
    std::vector<TrackingJob> tracking;
    std::vector<MotionJob> motion;
    void describe(auto& p) {
      p(axis, "axis", 0, 2, "0, 1, 2 for x, y, z");
      p(ripple, "ripple", "jobs that identify the force ripple");
      p(tracking, "tracking", "jobs that track sinusoids");
      p(motion, "motion", "jobs that move forth and back, to record and to compare");
      if constexpr (requires { p.node(); }) {
        std::set<std::string> names;
        job::check_names(p.node()["ripple"], ripple, names);
        job::check_names(p.node()["tracking"], tracking, names);
        job::check_names(p.node()["motion"], motion, names);
      }
    }
  };
  explicit AxisTrial(const Parameters& parameters) : AxisRunner{parameters.axis}, parameters_{parameters} {}
  [[nodiscard]] std::vector<Reach> reaches() const override;

 private:
  std::optional<Job> find(const std::string& wanted) override;
  void take_down(recording::Table& record) override;
  job::Task run(const RippleJob& job);
  job::Task run(const TrackingJob& job);
  job::Task run(const MotionJob& job);
  job::Task move_at_all_speeds(const MotionJob& job, recording::Table& record);
  job::Task compare(const MotionJob& job, recording::Table before);
  job::Task there_and_back(const RippleJob& job, double velocity, std::int64_t passes,
                           recording::Table& record);

  const Parameters& parameters_;
  Instant began_;           // the job; times in records count from here
  std::int64_t taken_ = 0;  // stamp of the last state in a record
};

}  // namespace invar::calibration
