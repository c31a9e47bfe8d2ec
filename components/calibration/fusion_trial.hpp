// FusionTrial: the sensors of an axis identified in the cell, from sinusoids beside a laser, and their fusion put to use.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "components/calibration/axis_runner.hpp"
#include "components/calibration/job_specs.hpp"
#include "core/component/parameters.hpp"
#include "core/metrology/fusion/fusion_identification.hpp"

namespace invar::calibration {

/// Sinusoids to identify from, and others before and after, which are not fitted.
struct FusionJob : job::JobSpec {
  double from = 0.0;
  double amplitude = 0.1;
  std::vector<double> periods{1.3, 2.0, 2.6, 3.5, 4.5, 6.0};
  std::vector<double> verify_periods{3.0, 5.0};
  void describe(auto& p) {
    job::JobSpec::describe(p);
    p(from, "from", "m", Range{-10.0, 10.0}, "where the sinusoids begin: their lower end");
    p(amplitude, "amplitude", "m", Range{-1.0, 1.0}, "half of the way");
    p(periods, "periods", "s", Range{1e-2, 1e4}, "one sinusoid each, to identify from");
    p(verify_periods, "verify_periods", "s", Range{1e-2, 1e4}, "those before and after");
    if constexpr (requires { p.node(); }) {
      if (periods.size() < 3)
        p.node()["periods"].fault("fewer than three sinusoids: none could be held out", "give three or more");
    }
  }
};

/// One axis; `model` is the model of its fusion, `fused` the fused position. Each sensor of the fusion has a port
/// `sensor_<name>`, or is the position or velocity of `feedback`. A model is kept where it lessens the error of runs that were
/// not fitted by more than chance: two standard errors over the parts of these runs. Else it is taken back. Where the observer
/// identifies the sensors while it runs, a model brings no more than that.
class FusionTrial final : public AxisRunner {
 public:
  struct Sensor {
    std::string name;
    std::string quantity = "position";
    std::string from = "port";
    void describe(auto& p);
  };
  struct Parameters {
    std::int64_t axis = 0;
    std::vector<Sensor> sensors;
    std::vector<FusionJob> jobs;
    void describe(auto& p) {
      p(axis, "axis", 0, 2, "0, 1, 2 for x, y, z");
      p(sensors, "sensors", "as the fusion has them");
      p(jobs, "jobs", "that identify them");
      if constexpr (requires { p.node(); }) {
        std::set<std::string> names;
        job::check_names(p.node()["jobs"], jobs, names);
        if (std::none_of(sensors.begin(), sensors.end(),
                         [](const Sensor& sensor) { return sensor.quantity == "position"; }))
          p.node()["sensors"].fault("none measures a position", "name the sensors of the fusion");
      }
    }
  };
  explicit FusionTrial(const Parameters& parameters);
  ~FusionTrial() override;
  [[nodiscard]] std::vector<Reach> reaches() const override;

 private:
  struct Source;
  /// Readings of one instant; NaN where there was none.
  struct Row;
  using Rows = std::map<std::int64_t, Row>;  // by the stamp [ns]

  std::optional<Job> find(const std::string& wanted) override;
  void take_down(recording::Table& record) override;
  job::Task run(const FusionJob& job);
  job::Task swing(const FusionJob& job, double period);
  /// Results of sinusoids that were not fitted.
  struct Verified {
    Size fused, tracked;  // errors by the laser: of the fused position, and of the axis that follows it
    std::vector<double>
        parts;  // how large the fused position's error is in each part of each sinusoid (logarithm)
  };
  job::Task verify(const FusionJob& job, const std::string& when, Verified& found);
  [[nodiscard]] metrology::FusionRun run_of_rows() const;

  const Parameters& parameters_;
  std::vector<std::unique_ptr<Source>> sources_;  // positions first
  std::size_t positions_ = 0;
  std::unique_ptr<Inbox<stage::AxisFeedback>> feedback_;
  Inbox<sensing::FusedPosition> fused_{*this, "fused", {}, 4096};
  Rows rows_;  // of the motion that runs
};

void FusionTrial::Sensor::describe(auto& p) {
  p(name, "name", "name of the sensor; its port is `sensor_<name>`");
  p(quantity, "quantity", "position or velocity");
  p(from, "from", "port, or feedback: the drive's own encoder or velocity");
  if constexpr (requires { p.node(); }) {
    if (quantity != "position" && quantity != "velocity")
      p.node()["quantity"].fault("`" + quantity + "` is not fused", "use position or velocity");
    if (from != "port" && from != "feedback")
      p.node()["from"].fault("`" + from + "` is no source", "use port or feedback");
  }
}

}  // namespace invar::calibration
