#include "components/calibration/axis_trial.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "core/base/new_file.hpp"
#include "core/job/wait.hpp"
#include "core/model/model_file.hpp"
#include "core/physics/ripple_identification.hpp"

namespace invar::calibration {

namespace {

recording::Table record_table() {
  recording::Table table;
  table.add("t", "s", {});
  for (const char* name : {"reference", "position"}) table.add(name, "m", {});
  table.add("current", "A", {});
  table.add("following_error", "m", {});
  table.add("laser", "m", {});
  return table;
}

/// Whether a model claims nothing beyond another: the same terms, no parameter moved by more than it is uncertain.
bool says_the_same(const physics::Model& believed, const physics::Model& other) {
  if (believed.terms.size() != other.terms.size()) return false;
  return std::all_of(believed.parameters.begin(), believed.parameters.end(), [&](const auto& parameter) {
    return std::abs(other.value(parameter.name) - parameter.value) <=
           3.0 * parameter.sigma.value_or(INFINITY);
  });
}

/// Following error in the parts of constant velocity.
std::vector<double> following(const recording::Table& table) {
  const auto time = table.in("t", "s"), reference = table.in("reference", "m"),
             error = table.in("following_error", "m");
  std::vector<double> errors;
  double steady_since = time.empty() ? 0.0 : time.front();
  double before = 0.0;
  for (std::size_t i = 1; i < time.size(); ++i) {
    const double velocity = (reference[i] - reference[i - 1]) / (time[i] - time[i - 1]);
    if (std::abs(velocity - before) > 0.02 * std::abs(velocity) || velocity == 0.0) steady_since = time[i];
    before = velocity;
    if (time[i] - steady_since > 0.25) errors.push_back(error[i]);
  }
  if (errors.empty()) throw std::runtime_error{"the runs are too short: no constant velocity in them"};
  return errors;
}

}  // namespace

std::vector<Reach> AxisTrial::reaches() const {
  std::vector<Reach> all;
  for (std::size_t i = 0; i < parameters_.ripple.size(); ++i)
    all.push_back({"ripple", i, parameters_.ripple[i].from, parameters_.ripple[i].to});
  for (std::size_t i = 0; i < parameters_.tracking.size(); ++i)
    all.push_back(reach_of("tracking", i, parameters_.tracking[i]));
  for (std::size_t i = 0; i < parameters_.motion.size(); ++i)
    all.push_back({"motion", i, parameters_.motion[i].from, parameters_.motion[i].to});
  return all;
}

std::optional<job::JobComponent::Job> AxisTrial::find(const std::string& wanted) {
  const auto begin = [&](const auto& job) {
    began_ = now();
    return Job{run(job), job.out};
  };
  if (const auto* ripple = job::named(parameters_.ripple, wanted)) return begin(*ripple);
  if (const auto* tracking = job::named(parameters_.tracking, wanted)) return begin(*tracking);
  if (const auto* motion = job::named(parameters_.motion, wanted)) return begin(*motion);
  return std::nullopt;
}

/// The newest state and what the laser says into the record; the setpoint of the laser's instant is known exactly.
void AxisTrial::take_down(recording::Table& record) {
  const auto* state = axis_.state.latest();
  double laser = std::numeric_limits<double>::quiet_NaN();
  sensing::DisplacementReading reading;
  while (reading_.take(reading)) {
    if (state == nullptr || !reading.valid()) continue;
    const double later = static_cast<double>(reading.at().time_ns() - state->at().time_ns()) * 1e-9;
    // What the reading would be at the instant of the state, were the following error the same.
    laser = beam_from_ + reading.displacement() -
            later * (state->setpoint_velocity() + 0.5 * later * state->setpoint_acceleration());
  }
  if (state == nullptr || state->at().time_ns() == taken_) return;
  taken_ = state->at().time_ns();
  const double row[] = {(Instant{taken_} - began_).in_seconds(),
                        state->setpoint_position(),
                        state->position(),
                        state->current(),
                        state->following_error(),
                        laser};
  for (std::size_t i = 0; i < record.columns.size(); ++i) record.columns[i].values.push_back(row[i]);
}

job::Task AxisTrial::there_and_back(const RippleJob& job, double velocity, std::int64_t passes,
                                    recording::Table& record) {
  for (std::int64_t pass = 0; pass < passes; ++pass) {
    co_await move(job.to, velocity, &record);
    co_await move(job.from, velocity, &record);
  }
}

job::Task AxisTrial::run(const RippleJob& job) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  const auto yaml = config::Yaml::load(job.model);
  physics::Model model = model::read(yaml);
  yaml.finish();
  if (model.plant != physics::Plant::axis) throw std::runtime_error{"the model is none of an axis"};
  co_await enable();
  co_await move(job.from, 0.0, nullptr);
  co_await job::wait(*this, settle);

  recording::Table before = record_table();
  co_await there_and_back(job, job.verify_velocity, 1, before);
  before.write(folder / "ripple_before.csv");
  progress_ = 0.2;
  report(job::JOB_RUNNING, "running slowly forth and back");
  recording::Table runs = record_table();
  co_await there_and_back(job, job.velocity, job.passes, runs);
  runs.write(folder / "runs.csv");
  progress_ = 0.7;

  report(job::JOB_RUNNING, "identifying the ripple");
  physics::Record record;
  record.time = runs.in("t", "s");
  for (const char* signal : {"reference", "position"}) record.signals[signal] = runs.in(signal, "m");
  record.signals["current"] = runs.in("current", "A");
  const auto samples = physics::constant_velocity_runs(record);
  if (samples.size() < 50) throw std::runtime_error{"the runs are too short: no constant velocity in them"};
  const auto fit = physics::identify_ripple(model, samples);
  if (fit.harmonics.empty()) {
    progress_ = 1.0;
    report(job::JOB_DONE, "no ripple stands out of the noise; nothing was changed");
    co_return;
  }
  for (const auto& term : physics::ripple_terms(fit)) model.terms.push_back(term);
  const auto patched = folder / "patched.yaml";
  {
    std::ofstream file = new_stream(patched);
    file << model::patched(yaml, model);
    if (!file.flush()) throw std::runtime_error{patched.string() + " cannot be written"};
  }
  co_await use_model(patched);
  progress_ = 0.8;
  report(job::JOB_RUNNING, "the ripple is fed forward; verifying");
  co_await job::wait(*this, 2.0);  // it fades in

  recording::Table after = record_table();
  co_await there_and_back(job, job.verify_velocity, 1, after);
  after.write(folder / "ripple_after.csv");
  const Size was = size_of(following(before));
  const Size is = size_of(following(after));
  if (is.rms > was.rms) {
    co_await roll_back_model();
    throw std::runtime_error{"the following error grew from " + micrometres(was.rms) + " to " +
                             micrometres(is.rms) + " RMS; rolled back"};
  }
  progress_ = 1.0;
  char pitch[32];
  std::snprintf(pitch, sizeof pitch, "%.4g mm", 1e3 * fit.pitch);
  report(job::JOB_DONE, std::string{"ripple of pitch "} + pitch + "; following error of runs not fitted " +
                            micrometres(was.rms) + " to " + micrometres(is.rms) + " RMS");
}

job::Task AxisTrial::run(const TrackingJob& job) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  co_await enable();
  recording::Table all = record_table();
  all.columns.insert(all.columns.begin(), {"period", "s", {}, {}});
  std::string found = "tracking error by the laser, RMS:";
  for (const double period : job.periods) {
    co_await move(job.from, 0.0, nullptr);
    co_await job::wait(*this, settle);
    co_await align(job.from);
    recording::Table record = record_table();
    stage::AxisCommand sine;
    sine.kind(stage::AXIS_COMMAND_SINE);
    sine.amplitude(job.amplitude);
    sine.period(period);
    sine.periods(static_cast<std::uint32_t>(job.cycles));
    co_await command_axis(sine, &record);
    std::vector<double> errors;
    const auto laser = record.in("laser", "m"), reference = record.in("reference", "m");
    for (std::size_t i = 0; i < record.rows(); ++i)
      if (std::isfinite(laser[i])) errors.push_back(laser[i] - reference[i]);
    if (errors.size() < 10)
      throw std::runtime_error{"no reading of the laser arrives: connect `reading` and `beam`"};
    char text[64];
    std::snprintf(text, sizeof text, "%s %g s ", found.back() == ':' ? "" : ",", period);
    found += text + micrometres(size_of(errors).rms);
    all.columns[0].values.insert(all.columns[0].values.end(), record.rows(), period);
    for (std::size_t i = 0; i < record.columns.size(); ++i)
      all.columns[i + 1].values.insert(all.columns[i + 1].values.end(), record.columns[i].values.begin(),
                                       record.columns[i].values.end());
    progress_ += 1.0 / static_cast<double>(job.periods.size());
    report(job::JOB_RUNNING, found);
  }
  all.write(folder / "tracking.csv");
  progress_ = 1.0;
  report(job::JOB_DONE, found);
}

job::Task AxisTrial::move_at_all_speeds(const MotionJob& job, recording::Table& record) {
  co_await move(job.from, 0.0, nullptr);
  co_await job::wait(*this, settle);
  for (const double velocity : job.velocities)
    for (std::int64_t pass = 0; pass < job.passes; ++pass)
      for (const double target : {job.to, job.from}) co_await move(target, velocity, &record);
  co_await job::wait(*this, settle);
}

job::Task AxisTrial::run(const MotionJob& job) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  co_await enable();
  recording::Table before = record_table();
  co_await move_at_all_speeds(job, before);
  before.write(folder / "motion_before.csv");
  std::filesystem::remove(folder / "motion_after.csv");  // of a run before
  if (!job.apply.empty()) {
    co_await compare(job, std::move(before));
    co_return;
  }
  const Size size = size_of(before.in("following_error", "m"));
  progress_ = 1.0;
  report(job::JOB_DONE,
         "following error " + micrometres(size.rms) + " RMS, at most " + micrometres(size.largest));
}

job::Task AxisTrial::compare(const MotionJob& job, recording::Table before) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  const auto file = std::filesystem::absolute(job.apply);
  if (says_the_same(model::load(job.model), model::load(file))) {
    progress_ = 1.0;
    report(job::JOB_DONE, "the diagnosis found nothing that the model lacks; nothing was given to the stage");
    co_return;
  }
  progress_ = 0.5;
  report(job::JOB_RUNNING, "giving the model to the stage");
  co_await use_model(file);
  co_await job::wait(*this, 2.0);  // it fades in
  recording::Table after = record_table();
  co_await move_at_all_speeds(job, after);
  after.write(folder / "motion_after.csv");
  const Size was = size_of(before.in("following_error", "m"));
  const Size is = size_of(after.in("following_error", "m"));
  if (is.rms > was.rms) {
    co_await roll_back_model();
    throw std::runtime_error{"the following error grew from " + micrometres(was.rms) + " to " +
                             micrometres(is.rms) + " RMS; rolled back"};
  }
  progress_ = 1.0;
  report(job::JOB_DONE, "following error of the same motion " + micrometres(was.rms) + " to " +
                            micrometres(is.rms) + " RMS, at most " + micrometres(was.largest) + " to " +
                            micrometres(is.largest));
}

}  // namespace invar::calibration
