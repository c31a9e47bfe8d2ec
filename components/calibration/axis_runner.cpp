#include "components/calibration/axis_runner.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "core/job/deliver.hpp"
#include "core/job/wait.hpp"

namespace invar::calibration {

Size size_of(const std::vector<double>& values) {
  Size size;
  double mean = 0.0;
  for (const double value : values) mean += value / static_cast<double>(values.size());
  for (const double value : values) {
    size.rms += std::pow(value - mean, 2) / static_cast<double>(values.size());
    size.largest = std::max(size.largest, std::abs(value - mean));
  }
  size.rms = std::sqrt(size.rms);
  return size;
}

std::string micrometres(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g um", 1e6 * value);
  return text;
}

void AxisRunner::make_safe() {
  stage::AxisCommand stop;
  stop.kind(stage::AXIS_COMMAND_STOP);
  axis_.send(stop, next_command_id());
}

/// Sends a command and waits until it has ended; what happens meanwhile goes into the record, where there is one.
job::Task AxisRunner::command_axis(stage::AxisCommand command, recording::Table* record) {
  axis_.send(command, next_command_id());
  const std::string refused = axis_.said() + " refused a motion of the job";
  const Instant started = now();
  for (;;) {
    co_await job::NextStep{};
    if (record != nullptr) take_down(*record);
    const JobAxis::Motion motion = axis_.follow(refused);
    if (motion.done) co_return;
    if (!motion.answered && now() - started > Duration::seconds(5.0))
      throw std::runtime_error{"the axis does not answer: is its stage active?"};
  }
}

/// A carriage that nobody held comes to rest in the hands of its loop before the job moves it.
job::Task AxisRunner::enable() {
  const auto* state = axis_.state.latest();
  if (state != nullptr && state->enabled()) co_return;
  const Instant asked = now();
  std::vector<JobAxis*> axes{&axis_};
  CommandIds ids = [this] { return next_command_id(); };
  co_await enable_axes(axes, ids, Duration::seconds(10.0));
  co_await job::wait(*this, 0.5 - (now() - asked).in_seconds());
}

job::Task AxisRunner::move(double target, double velocity, recording::Table* record) {
  stage::AxisCommand command;
  command.kind(stage::AXIS_COMMAND_MOVE);
  command.position(target);
  command.velocity(velocity);
  co_await command_axis(command, record);
}

job::Task AxisRunner::align(double from) {
  sensing::BeamCommand beam;
  stamp(beam);
  beam.id(next_command_id());
  beam.beam_start()[static_cast<std::size_t>(number_)] = from;
  beam.beam_direction()[static_cast<std::size_t>(number_)] = 1.0;
  beam_.write(beam);
  beam_from_ = from;
  co_await job::wait(*this, 0.1);
  sensing::DisplacementReading before;
  while (reading_.take(before)) {  // of another beam
  }
}

job::Task AxisRunner::use_model(const std::filesystem::path& model) {
  std::string path;
  co_await job::deliver(*this, model_, model, path);
  co_await command_model(compensation::MODEL_STAGE, path);
  co_await command_model(compensation::MODEL_ACTIVATE, path);
}

job::Task AxisRunner::roll_back_model() { co_await command_model(compensation::MODEL_ROLLBACK, ""); }

job::Task AxisRunner::command_model(compensation::ModelCommandKind kind, const std::string& path) {
  compensation::ModelCommand command;
  stamp(command);
  command.id(next_command_id());
  command.kind(kind);
  command.path(path);
  model_.write(command);
  const Instant give_up = now() + Duration::seconds(5.0);
  for (;;) {
    co_await job::NextStep{};
    const auto* status = model_status_.latest();
    if (status != nullptr && status->command_id() == command.id()) {
      if (status->state() == compensation::MODEL_REFUSED)
        throw std::runtime_error{"the model was refused: " + std::string{status->text().c_str()}};
      co_return;
    }
    if (now() > give_up)
      throw std::runtime_error{"nobody answers to the model: connect `model` and `model_status`"};
  }
}

}  // namespace invar::calibration
