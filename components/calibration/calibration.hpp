// Calibration: runs the measuring jobs of a cell - moves, settles, reads, identifies, activates, verifies.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "components/calibration/axis_link.hpp"
#include "components/calibration/job_component.hpp"
#include "components/calibration/job_host.hpp"
#include "components/calibration/job_specs.hpp"
#include "components/calibration/loop_watch.hpp"
#include "components/calibration/printing.hpp"
#include "components/calibration/task.hpp"
#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/metrology/thermal/heat_trace.hpp"
#include "core/metrology/thermal/thermal_identification.hpp"
#include "core/recording/table.hpp"
#include "idl/compensation.h"
#include "idl/job.h"
#include "idl/sensing.h"
#include "idl/stage.h"
#include "idl/thermal.h"

namespace invar::calibration {

/// A job is a transaction on the compensation. Its model is put to use on trial, watched, and kept
/// only if it makes the error smaller. A job that fails, is cancelled or dies leaves the models as they were.
class Calibration final : public JobComponent, private JobHost {
 public:
  struct Parameters {
    std::int64_t axes = 2;
    double settle_timeout = 2.0;
    double velocity = 0.0;
    std::vector<GeometricJob> jobs;
    std::vector<ThermalJob> thermal_jobs;
    std::vector<PrintJob> prints;
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
        check_names(p.node()["jobs"], jobs, names);
        check_names(p.node()["thermal_jobs"], thermal_jobs, names);
        check_names(p.node()["prints"], prints, names);
        for (const PrintJob& print : prints)
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
  using Point = Eigen::Vector3d;
  struct Axis {
    Axis(Calibration& owner, std::size_t number)
        : state{owner, std::string{"state_"} + "xyz"[number]},
          command{owner, std::string{"command_"} + "xyz"[number], "command"} {}
    Input<stage::AxisState> state;
    Output<stage::AxisCommand> command;
    std::uint64_t last_command = 0;
    LoopWatch loop;  // of the motion under way
    AxisLink link;
    bool taken = false;  // it is under way
  };

  // calibration.cpp: jobs, and what all of them are made of.
  std::optional<Job> find(const std::string& wanted) override;
  void make_safe() override;
  void tend(bool job_runs) override;
  void send(std::size_t axis, stage::AxisCommandKind kind, double position = 0.0, const Pace& pace = {});
  Task run(const PrintJob& job);
  void tell(const std::string& text, double progress) override;
  std::uint64_t next_id() override { return next_command_id(); }
  Task enable_axes() override;
  Task move_to(Point target, Pace pace) override;
  Task wait(double seconds);
  Task align(Point from, Point to);
  Task average_reading(std::int64_t count, double& mean);

  // transaction.cpp: the compensation's models.
  Task clear_models(const std::string& layers);
  Task use_model(const std::filesystem::path& model);
  Task keep_models();
  Task roll_back(const std::string& why);
  Task command_model(compensation::ModelCommandKind kind, const std::string& path);
  std::uint64_t send_model(compensation::ModelCommandKind kind, const std::string& path);
  void watch_transaction();
  void abandon_transaction();

  // geometric_job.cpp
  Task run(const GeometricJob& job);
  Task calibrate(const GeometricJob& job);
  Task measure(const LineSpec& line, double interval, std::int64_t cycles, std::int64_t readings,
               double share, recording::Table& table);

  // thermal_job.cpp
  struct Pass {
    const ThermalJob& job;
    bool between = false;  // at points in the middle between those that are fitted
    double number = 0.0;
    std::string model;  // in use meanwhile; empty: none
  };
  Task run(const ThermalJob& job);
  Task reach(const ThermalJob& job, double temperature);
  Task pass(const Pass& what, recording::Table& table);  // `what` outlives it
  Task compare(const ThermalJob& job, const TraceSpec* trace,
               const std::array<std::filesystem::path, 2>& files, recording::Table& table);
  [[nodiscard]] recording::Table heat_table(bool with_models) const;
  void set_heater(double setpoint);
  void follow_heat();

  const Parameters& parameters_;
  Inbox<sensing::DisplacementReading> reading_{*this, "reading", {.profile = "calibration"}, 4096};
  Output<sensing::BeamCommand> beam_{*this, "beam", "command"};
  Output<compensation::ModelCommand> model_{*this, "model", "command"};
  Input<compensation::ModelStatus> model_status_{
      *this, "model_status", {.optional = true, .profile = "state"}};
  Input<thermal::NodeTemperature> temperature_{*this, "temperature", {.optional = true, .profile = "state"}};
  Output<thermal::ThermalCommand> heater_{*this, "heater", "command"};
  std::vector<std::unique_ptr<Input<thermal::NodeTemperature>>> zones_;
  std::vector<std::unique_ptr<Axis>> axes_;
  std::unique_ptr<Printing> printing_;  // only where there are print jobs: its ports must be connected

  std::uint64_t transaction_ = 0;   // ours on the compensation; 0: none
  bool transaction_known_ = false;  // the compensation has confirmed it
  Instant kept_at_;

  metrology::HeatTrace heat_;
  metrology::ThermalReadings::History heat_history_;
  const TraceSpec* trace_ = nullptr;  // that the heater follows
  Instant trace_start_;
  Instant began_;  // the thermal job; times in its files count from here
  Instant set_at_;
  std::optional<double> setpoint_before_;  // of the heater, before the job

 public:
  ~Calibration() override;
};

}  // namespace invar::calibration
