// AxisRunner: jobs that move one axis while a laser looks along it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "components/calibration/job_axis.hpp"
#include "core/job/job_component.hpp"
#include "core/recording/table.hpp"
#include "idl/compensation.h"
#include "idl/sensing.h"
#include "idl/stage.h"

namespace invar::calibration {

constexpr double settle = 0.5;  // s, at rest before something is measured

struct Size {
  double rms = 0.0, largest = 0.0;
};
/// Size of values after their mean is taken out.
Size size_of(const std::vector<double>& values);
/// With its unit, for what a job says.
std::string micrometres(double value);

/// The way of a job, as its stage will be asked to go: both ends [m], and where the file states the job: `list[place]`.
struct Reach {
  std::string list;
  std::size_t place = 0;
  double from = 0.0, to = 0.0;
};

/// A job of sinusoids: from its lower end over two amplitudes.
template <class Job>
Reach reach_of(std::string list, std::size_t place, const Job& job) {
  return {std::move(list), place, job.from, job.from + 2.0 * job.amplitude};
}

/// Its stage on `state` and `command`, a laser along the axis on `reading` and `beam`, and on `model` what uses the model that
/// a job makes. Not real-time.
class AxisRunner : public job::JobComponent {
 public:
  /// The ways of all its jobs.
  [[nodiscard]] virtual std::vector<Reach> reaches() const = 0;

 protected:
  explicit AxisRunner(const std::int64_t& axis) : number_{axis}, axis_{*this, number_, "state", "command"} {}
  /// Adds the row of a step to the record of a motion.
  virtual void take_down(recording::Table& record) = 0;

  job::Task enable();
  /// A command to its end; nullptr: nothing is taken down. A loop that is at its current limit or trips fails the job.
  job::Task command_axis(stage::AxisCommand command, recording::Table* record);
  job::Task move(double target, double velocity, recording::Table* record);
  /// Zeroes the laser where the tool stands, which is called `from` [m].
  job::Task align(double from);
  job::Task use_model(const std::filesystem::path& model);
  job::Task roll_back_model();

  const std::int64_t& number_;
  JobAxis axis_;
  Inbox<sensing::DisplacementReading> reading_{
      *this, "reading", {.optional = true, .profile = "calibration"}, 4096};
  double beam_from_ = 0.0;  // where the laser was zeroed [m]

 private:
  void make_safe() override;
  job::Task command_model(compensation::ModelCommandKind kind, const std::string& path);

  Output<sensing::BeamCommand> beam_{*this, "beam", "command"};
  Output<compensation::ModelCommand> model_{*this, "model", "command"};
  Input<compensation::ModelStatus> model_status_{
      *this, "model_status", {.optional = true, .profile = "state"}};
};

}  // namespace invar::calibration
