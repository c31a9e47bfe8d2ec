// Calibration: runs the measuring jobs of a cell - moves, settles, reads, identifies, activates, verifies.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "components/calibration/job_host.hpp"
#include "components/calibration/printing.hpp"
#include "components/calibration/task.hpp"
#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/recording/table.hpp"
#include "idl/compensation.h"
#include "idl/job.h"
#include "idl/sensing.h"
#include "idl/stage.h"

namespace invar::calibration {

/// A displacement line to measure.
struct LineSpec {
  std::string name;
  std::vector<double> from;
  std::vector<double> to;
  void describe(auto& p) {
    p(name, "name", "of the line, in the files");
    p(from, "from", "m", "commanded start, one number an axis");
    p(to, "to", "m", "commanded end");
    if constexpr (requires { p.node(); }) {
      if (from.size() != to.size() || from.empty() || from.size() > 3)
        p.node().fault("`from` and `to` need one number an axis each", "write from: [0, 0] and to: [0.2, 0]");
    }
  }
};

/// One geometric calibration as a transaction: lines to fit, lines to verify before and after.
struct GeometricJob {
  std::string name;
  std::filesystem::path machine;
  std::vector<LineSpec> lines;
  std::vector<LineSpec> verify;
  double interval = 0.01;
  double verify_interval = 0.005;
  std::int64_t cycles = 1;
  std::int64_t readings = 4;
  std::string out = "out";
  void describe(auto& p) {
    p(name, "name", "what `invar job run` calls it");
    p(machine, "machine", "machine.yaml: chain and travel");
    p(lines, "lines", "displacement lines to identify the error from");
    p(verify, "verify", "lines not fitted, measured before and after");
    p(interval, "interval", "m", Range{1e-4, 1.0}, "between the points of a line");
    p(verify_interval, "verify_interval", "m", Range{1e-4, 1.0}, "between the points of a verification line");
    p(cycles, "cycles", 1, 100, "each line forth and back so often");
    p(readings, "readings", 1, 10'000, "averaged at each point");
    p(out, "out", "folder for the files, created; relative to where the cell was started");
  }
};

class Calibration final : public Component, private JobHost {
 public:
  struct Parameters {
    std::int64_t axes = 2;
    double settle_timeout = 2.0;
    double velocity = 0.0;
    std::vector<GeometricJob> jobs;
    std::vector<PrintJob> prints;
    void describe(auto& p) {
      p(axes, "axes", 1, 3, "how many axes the machine has");
      p(settle_timeout, "settle_timeout", "s", Range{0.01, 600.0},
        "the job fails when an axis needs longer to settle");
      p(velocity, "velocity", "m/s", Range{0.0, 10.0}, "of the moves; 0: the stage's own");
      p(jobs, "jobs", "geometric calibrations that can be run");
      p(prints, "prints", "print jobs that can be run");
      if constexpr (requires { p.node(); })
        for (const PrintJob& print : prints)
          if (!print.first.empty() && std::none_of(jobs.begin(), jobs.end(),
                                                   [&](const auto& job) { return job.name == print.first; }))
            p.node()["prints"].fault("`" + print.first + "` is no job of `jobs`",
                                     "name one of them, or leave `first` out");
    }
  };
  explicit Calibration(const Parameters& parameters);
  void activate() override;
  void step(const Tick& tick) noexcept override;
  void deactivate() noexcept override;

 private:
  using Point = Eigen::Vector3d;
  struct Verification {
    double maximum = 0.0;  // m
    double rms = 0.0;      // m
  };

  void start(const job::JobCommand& command);
  Task run(const GeometricJob& job);
  Task run(const PrintJob& job);
  Task calibrate(const GeometricJob& job);
  Task enable_axes() override;
  Task move_to(Point target, Pace pace) override;
  void tell(const std::string& text, double progress) override;
  std::uint64_t next_id() override { return static_cast<std::uint64_t>(id) << 32U | next_command_++; }
  void stop();
  Task average_reading(std::int64_t count, double& mean);
  Task measure(const LineSpec& line, double interval, std::int64_t cycles, std::int64_t readings,
               double share, recording::Table& table);
  Task command_model(compensation::ModelCommandKind kind, const std::string& path);
  Verification evaluate(const recording::Table& table) const;
  void report(job::JobPhase phase, const std::string& text);
  void send(std::size_t axis, stage::AxisCommandKind kind, double position = 0.0, const Pace& pace = {});

  const Parameters& parameters_;
  Inbox<job::JobCommand> job_{*this, "job", {.optional = true, .profile = "command"}};
  Output<job::JobStatus> status_{*this, "status", "state"};
  Inbox<sensing::DisplacementReading> reading_{*this, "reading", {.profile = "calibration"}, 4096};
  Output<sensing::BeamCommand> beam_{*this, "beam", "command"};
  Output<compensation::ModelCommand> model_{*this, "model", "command"};
  Input<compensation::ModelStatus> model_status_{
      *this, "model_status", {.optional = true, .profile = "state"}};
  struct Axis;
  std::vector<std::unique_ptr<Axis>> axes_;
  std::unique_ptr<Printing> printing_;  // only where there are print jobs: its ports must be connected

  Task task_;
  job::JobStatus sample_;
  double progress_ = 0.0;
  std::uint64_t next_command_ = 1;
  std::uint64_t cycle_ = 0;

 public:
  ~Calibration() override;
};

}  // namespace invar::calibration
