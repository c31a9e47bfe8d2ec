#include "components/calibration/fusion_trial.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>

#include "core/compensation/fusion_file.hpp"
#include "core/job/wait.hpp"
#include "core/numerics/sure_gain.hpp"

namespace invar::calibration {

namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t parts_of_run = 8;  // of a sinusoid: longer than the fused position's error remembers

using Readings = std::array<double, metrology::most_sensors>;

Readings no_readings() {
  Readings readings;
  readings.fill(nothing);
  return readings;
}

std::string millimetres(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g mm", 1e3 * value);
  return text;
}

/// The first sensor, which the axis was homed by, keeps its zero: the laser's was wherever the tool stood.
void keep_zero(std::vector<metrology::FusionRun>& runs) {
  double off = 0.0, count = 0.0;
  for (const auto& run : runs)
    for (Eigen::Index i = 0; i < run.time.size(); ++i)
      if (std::isfinite(run.positions(i, 0))) off += run.positions(i, 0) - run.reference(i), ++count;
  if (count < 100.0) throw std::runtime_error{"the first position sensor does not read: connect it"};
  for (auto& run : runs) run.reference.array() += off / count;
}

/// Logarithm of the mean square of the errors of each part, the mean of all taken out: so that no one part decides.
std::vector<double> sizes_of_parts(const std::vector<double>& errors, const std::vector<std::size_t>& part_of,
                                   std::size_t parts) {
  double mean = 0.0;
  for (const double error : errors) mean += error / static_cast<double>(errors.size());
  std::vector<double> sizes(parts), counts(parts);
  for (std::size_t i = 0; i < errors.size(); ++i) {
    sizes[part_of[i]] += std::pow(errors[i] - mean, 2);
    counts[part_of[i]] += 1.0;
  }
  for (std::size_t k = 0; k < parts; ++k)
    sizes[k] = std::log(std::max(1e-20, sizes[k] / std::max(1.0, counts[k])));
  return sizes;
}

/// As `invar calibrate fusion` reads it.
recording::Table table_of(const std::vector<metrology::FusionRun>& runs,
                          const std::vector<std::string>& names, std::size_t positions) {
  recording::Table table;
  table.add("run", "", {});
  table.add("t", "s", {});
  table.add("reference", "m", {});
  for (std::size_t k = 0; k < names.size(); ++k)
    table.add((k < positions ? "position_" : "velocity_") + names[k], k < positions ? "m" : "m/s", {});
  for (std::size_t r = 0; r < runs.size(); ++r)
    for (Eigen::Index i = 0; i < runs[r].time.size(); ++i) {
      auto column = table.columns.begin();
      for (const double value : {static_cast<double>(r + 1), runs[r].time(i), runs[r].reference(i)})
        (column++)->values.push_back(value);
      for (const double value : runs[r].positions.row(i)) (column++)->values.push_back(value);
      for (const double value : runs[r].velocities.row(i)) (column++)->values.push_back(value);
    }
  return table;
}

}  // namespace

struct FusionTrial::Source {
  Source(FusionTrial& owner, const Sensor& sensor)
      : name{sensor.name}, is_position{sensor.quantity == "position"} {
    if (sensor.from == "port")
      reading =
          std::make_unique<Inbox<sensing::AxisReading>>(owner, "sensor_" + sensor.name, InputOptions{}, 4096);
  }
  std::string name;
  bool is_position;
  std::unique_ptr<Inbox<sensing::AxisReading>> reading;  // nullptr: from `feedback`
};

struct FusionTrial::Row {
  double laser = nothing;
  double setpoint = nothing;
  double fused = nothing;
  Readings sensors = no_readings();
};

FusionTrial::FusionTrial(const Parameters& parameters)
    : AxisRunner{parameters.axis}, parameters_{parameters} {
  for (const bool position : {true, false})
    for (const Sensor& sensor : parameters.sensors) {
      if ((sensor.quantity == "position") != position) continue;
      sources_.push_back(std::make_unique<Source>(*this, sensor));
      positions_ += position ? 1U : 0U;
      if (sensor.from == "feedback" && feedback_ == nullptr)
        feedback_ = std::make_unique<Inbox<stage::AxisFeedback>>(*this, "feedback", InputOptions{}, 4096);
    }
}

FusionTrial::~FusionTrial() = default;

std::vector<Reach> FusionTrial::reaches() const {
  std::vector<Reach> all;
  for (std::size_t i = 0; i < parameters_.jobs.size(); ++i)
    all.push_back(reach_of("jobs", i, parameters_.jobs[i]));
  return all;
}

std::optional<job::JobComponent::Job> FusionTrial::find(const std::string& wanted) {
  const auto* job = job::named(parameters_.jobs, wanted);
  if (job == nullptr) return std::nullopt;
  return Job{run(*job), job->out};
}

/// Everything that was read since the last step, by its stamp.
void FusionTrial::take_down(recording::Table&) {
  sensing::DisplacementReading laser;
  while (reading_.take(laser))
    if (laser.valid()) rows_[laser.at().time_ns()].laser = beam_from_ + laser.displacement();
  stage::AxisFeedback feedback;
  while (feedback_ != nullptr && feedback_->take(feedback))
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (sources_[i]->reading == nullptr)
        rows_[feedback.at().time_ns()].sensors[i] =
            sources_[i]->is_position ? feedback.position() : feedback.velocity();
  sensing::AxisReading reading;
  for (std::size_t i = 0; i < sources_.size(); ++i)
    while (sources_[i]->reading != nullptr && sources_[i]->reading->take(reading))
      rows_[reading.at().time_ns()].sensors[i] =
          sources_[i]->is_position ? reading.position() : reading.velocity();
  sensing::FusedPosition fused;
  while (fused_.take(fused)) rows_[fused.at().time_ns()].fused = fused.position();
  if (const auto* state = axis_.state.latest(); state != nullptr)
    rows_[state->at().time_ns()].setpoint = state->setpoint_position();
}

/// One sinusoid from rest; what was read stands in `rows_` afterwards.
job::Task FusionTrial::swing(const FusionJob& job, double period) {
  co_await move(job.from, 0.0, nullptr);
  co_await job::wait(*this, settle);
  recording::Table unused;
  take_down(unused);  // what waited
  rows_.clear();
  stage::AxisCommand sine;
  sine.kind(stage::AXIS_COMMAND_SINE);
  sine.amplitude(job.amplitude);
  sine.period(period);
  sine.periods(1);
  co_await command_axis(sine, &unused);
  std::erase_if(rows_, [](const auto& row) { return !std::isfinite(row.second.laser); });
  if (rows_.size() < 100)
    throw std::runtime_error{"no reading of the laser arrives: connect `reading` and `beam`"};
}

metrology::FusionRun FusionTrial::run_of_rows() const {
  const auto n = static_cast<Eigen::Index>(rows_.size());
  const auto positions = static_cast<Eigen::Index>(positions_);
  const Eigen::Index velocities = static_cast<Eigen::Index>(sources_.size()) - positions;
  metrology::FusionRun run{Eigen::VectorXd(n),
                           Eigen::VectorXd(n),
                           Eigen::MatrixXd(n, positions),
                           Eigen::MatrixXd(n, velocities),
                           {},
                           {}};
  Eigen::Index i = 0;
  for (const auto& [stamp, row] : rows_) {
    run.time(i) = static_cast<double>(stamp - rows_.begin()->first) * 1e-9;
    run.reference(i) = row.laser;
    for (Eigen::Index k = 0; k < positions + velocities; ++k) {
      const double value = row.sensors[static_cast<std::size_t>(k)];
      if (k < positions)
        run.positions(i, k) = value;
      else
        run.velocities(i, k - positions) = value;
    }
    ++i;
  }
  return run;
}

job::Task FusionTrial::verify(const FusionJob& job, const std::string& when, Verified& found) {
  std::vector<double> of_fused, of_axis;
  std::vector<std::size_t> part_of;  // each error of the fused position
  recording::Table table;
  for (const char* time : {"period", "t"}) table.add(time, "s", {});
  for (const char* place : {"reference", "fused", "setpoint"}) table.add(place, "m", {});
  std::size_t first_part = 0;
  for (const double period : job.verify_periods) {
    co_await swing(job, period);
    for (const auto& [stamp, row] : rows_) {
      const double t = static_cast<double>(stamp - rows_.begin()->first) * 1e-9;
      if (std::isfinite(row.fused)) {
        of_fused.push_back(row.fused - row.laser);
        const auto part = static_cast<std::size_t>(t / period * parts_of_run);
        part_of.push_back(first_part + std::min(part, parts_of_run - 1));
      }
      if (std::isfinite(row.setpoint)) of_axis.push_back(row.laser - row.setpoint);
      const double cells[] = {period, t, row.laser, row.fused, row.setpoint};
      for (std::size_t c = 0; c < table.columns.size(); ++c) table.columns[c].values.push_back(cells[c]);
    }
    first_part += parts_of_run;
  }
  if (of_fused.size() < 100) throw std::runtime_error{"nothing fused arrives: connect `fused`"};
  table.write(std::filesystem::absolute(job.out) / ("fusion_" + when + ".csv"));
  found = {size_of(of_fused), size_of(of_axis), sizes_of_parts(of_fused, part_of, first_part)};
}

job::Task FusionTrial::run(const FusionJob& job) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  co_await enable();
  co_await move(job.from, 0.0, nullptr);
  co_await job::wait(*this, settle);
  co_await align(job.from);
  Verified before, after;
  co_await verify(job, "before", before);
  progress_ = 0.2;
  report(job::JOB_RUNNING, "sinusoids beside the laser");
  std::vector<metrology::FusionRun> runs;
  for (const double period : job.periods) {
    co_await swing(job, period);
    runs.push_back(run_of_rows());
    progress_ += 0.5 / static_cast<double>(job.periods.size());
  }

  keep_zero(runs);
  std::vector<std::string> names;
  for (const auto& source : sources_) names.push_back(source->name);
  table_of(runs, names, positions_).write(folder / "fusion.csv");

  report(job::JOB_RUNNING, "identifying the sensors");
  const auto middle = names.begin() + static_cast<std::ptrdiff_t>(positions_);
  const metrology::FusionFit fit = metrology::identify_fusion(
      runs, {names.begin(), middle}, {middle, names.end()}, {.noise_estimated = true});
  const bool observer = fit.method == metrology::FusionMethod::observer;
  compensation::ModelText text{"fusion", {folder / "fusion.csv"}};
  compensation::write_fusion(text, {observer ? "observer" : "weights", false, fit.sensors, fit.weights, ""});
  const auto file = folder / "compensation.yaml";
  text.write(file);
  co_await move(job.from, 0.0, nullptr);
  co_await job::wait(*this, settle);
  co_await use_model(file);
  progress_ = 0.8;
  report(job::JOB_RUNNING, "the model is in use; verifying");
  co_await verify(job, "after", after);
  const std::string fused = "fused position of runs not fitted " + millimetres(before.fused.rms) + " to " +
                            millimetres(after.fused.rms) + " RMS by the laser";
  progress_ = 1.0;
  if (after.fused.rms >= before.fused.rms || !numerics::surely_less(after.parts, before.parts, 2.0)) {
    co_await move(job.from, 0.0, nullptr);
    co_await roll_back_model();
    report(job::JOB_DONE, fused + ": no more than chance gives; the fusion is as it was before");
    co_return;
  }
  report(job::JOB_DONE, fused + ", the axis that follows it " + millimetres(before.tracked.rms) + " to " +
                            millimetres(after.tracked.rms) + "; method " +
                            (observer ? "observer" : "weights"));
}

}  // namespace invar::calibration
