#include "components/calibration/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "components/calibration/identify.hpp"

namespace invar::calibration {

namespace {

constexpr const char* letters[] = {"x", "y", "z"};

Eigen::Vector3d point_of(const std::vector<double>& numbers) {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < numbers.size(); ++i) point[static_cast<Eigen::Index>(i)] = numbers[i];
  return point;
}

recording::Table lines_table() {
  recording::Table table;
  table.add_texts("line", {});
  for (const char* name : {"x", "y", "z"}) table.add(name, "m", {});
  table.add("displacement", "m", {});
  table.add("cycle", "", {});
  table.add("direction", "", {});
  return table;
}

void append(recording::Table& table, const std::string& line, const Eigen::Vector3d& point,
            double displacement, double cycle, double direction) {
  table.columns[0].texts.push_back(line);
  const double row[] = {std::numeric_limits<double>::quiet_NaN(),
                        point.x(),
                        point.y(),
                        point.z(),
                        displacement,
                        cycle,
                        direction};
  for (std::size_t i = 0; i < table.columns.size(); ++i) table.columns[i].values.push_back(row[i]);
}

}  // namespace

struct Calibration::Axis {
  Axis(Calibration& owner, std::size_t number)
      : state{owner, std::string{"state_"} + letters[number]},
        command{owner, std::string{"command_"} + letters[number], "command"} {}
  Input<stage::AxisState> state;
  Output<stage::AxisCommand> command;
  std::uint64_t last_command = 0;
};

Calibration::Calibration(const Parameters& parameters) : parameters_{parameters} {
  for (std::size_t i = 0; i < static_cast<std::size_t>(parameters.axes); ++i)
    axes_.push_back(std::make_unique<Axis>(*this, i));
  JobHost& host = *this;
  if (!parameters.prints.empty()) printing_ = std::make_unique<Printing>(*this, host);
}

Calibration::~Calibration() = default;

void Calibration::activate() {
  task_ = {};
  report(job::JOB_IDLE, "ready");
}

void Calibration::deactivate() noexcept {
  if (task_.running()) report(job::JOB_CANCELLED, "the component was deactivated");
  task_ = {};
}

void Calibration::report(job::JobPhase phase, const std::string& text) {
  sample_.cell(cell);
  sample_.component_id(id);
  sample_.at().time_ns(now().ns);
  sample_.at().cycle(cycle_);
  sample_.phase(phase);
  sample_.progress(progress_);
  sample_.text(text);
  status_.write(sample_);
}

void Calibration::start(const job::JobCommand& command) {
  if (command.kind() == job::JOB_CANCEL) {
    if (!task_.running()) return;
    stop();
    report(job::JOB_CANCELLED, "cancelled");
    return;
  }
  if (command.id() == sample_.id() && sample_.id() != 0) return;  // the same request again
  const std::string wanted{command.name().c_str()};
  const auto named = [&](const auto& job) { return job.name == wanted; };
  const auto found = std::find_if(parameters_.jobs.begin(), parameters_.jobs.end(), named);
  const auto print = std::find_if(parameters_.prints.begin(), parameters_.prints.end(), named);
  if (task_.running()) {
    report(job::JOB_RUNNING, "job `" + std::string{sample_.name().c_str()} + "` is running; cancel it first");
    return;
  }
  sample_.id(command.id());
  sample_.name(wanted);
  progress_ = 0.0;
  if (found == parameters_.jobs.end() && print == parameters_.prints.end()) {
    report(job::JOB_FAILED, "`" + wanted + "` is no job of this component");
    return;
  }
  const bool geometric = found != parameters_.jobs.end();
  sample_.result_path(std::filesystem::absolute(geometric ? found->out : print->out).string());
  task_ = geometric ? run(*found) : run(*print);
  report(job::JOB_RUNNING, "started");
}

void Calibration::step(const Tick& tick) noexcept {
  cycle_ = tick.cycle;
  try {
    job::JobCommand command;
    while (job_.take(command)) start(command);
    if (task_.running()) {
      task_.resume();
    } else {
      sensing::DisplacementReading unused;
      while (reading_.take(unused)) {
      }
    }
  } catch (const std::exception& error) {
    stop();
    report(job::JOB_FAILED, error.what());
  }
}

void Calibration::stop() {
  task_ = {};
  for (std::size_t i = 0; i < axes_.size(); ++i) send(i, stage::AXIS_COMMAND_STOP);
  if (printing_) printing_->make_safe();
}

void Calibration::tell(const std::string& text, double progress) {
  progress_ = progress;
  report(job::JOB_RUNNING, text);
}

void Calibration::send(std::size_t axis, stage::AxisCommandKind kind, double position, const Pace& pace) {
  stage::AxisCommand command;
  command.cell(cell);
  command.axis(static_cast<std::uint32_t>(axis));
  command.at().time_ns(now().ns);
  command.at().cycle(cycle_);
  command.id(next_id());
  command.kind(kind);
  command.position(position);
  command.velocity(pace.velocity > 0.0 ? pace.velocity : parameters_.velocity);
  command.acceleration(pace.acceleration);
  command.jerk(pace.jerk);
  axes_[axis]->last_command = command.id();
  axes_[axis]->command.write(command);
}

/// Processes come up in any order: asks again until every axis is enabled.
Task Calibration::enable_axes() {
  const Instant give_up = now() + Duration::seconds(10.0) + Duration::seconds(parameters_.settle_timeout);
  Instant ask_at = now();
  for (;;) {
    if (now() >= ask_at) {
      for (std::size_t i = 0; i < axes_.size(); ++i) send(i, stage::AXIS_COMMAND_ENABLE);
      ask_at = now() + Duration::seconds(0.5);
    }
    co_await NextStep{};
    const bool all = std::all_of(axes_.begin(), axes_.end(), [](const auto& axis) {
      const auto* state = axis->state.latest();
      return state != nullptr && state->command_id() == axis->last_command && state->enabled();
    });
    if (all) co_return;
    if (now() > give_up)
      throw std::runtime_error{"an axis does not answer to `enable`: is its stage active?"};
  }
}

/// Moves all axes and waits until they have settled there. With a pace every axis takes its share of it, so that the path is
/// straight.
Task Calibration::move_to(Point target, Pace pace) {
  Point way = Point::Zero();
  for (std::size_t i = 0; i < axes_.size(); ++i)
    if (const auto* state = axes_[i]->state.latest(); state != nullptr)
      way[static_cast<Eigen::Index>(i)] = target[static_cast<Eigen::Index>(i)] - state->setpoint_position();
  const Point share = way.norm() > 0.0 ? Point{way.cwiseAbs() / way.norm()} : Point::Zero();
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    send(i, stage::AXIS_COMMAND_MOVE, target[k],
         {share[k] * pace.velocity, share[k] * pace.acceleration, share[k] * pace.jerk});
  }
  std::optional<Instant> arrived;
  const Instant started = now();
  for (;;) {
    co_await NextStep{};
    bool done = true;
    bool settled = true;
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      const auto* state = axes_[i]->state.latest();
      const bool answered = state != nullptr && state->command_id() == axes_[i]->last_command;
      if (answered && state->command_refused())
        throw std::runtime_error{std::string{"axis "} + letters[i] + " refused to move to " +
                                 std::to_string(target[static_cast<Eigen::Index>(i)]) + " m"};
      if (state != nullptr && state->mode() == stage::AXIS_MODE_FAULT)
        throw std::runtime_error{std::string{"axis "} + letters[i] + " tripped while moving"};
      done = done && answered && state->command_done();
      settled = settled && answered && state->settled();
    }
    if (done && settled) co_return;
    if (done && !arrived) arrived = now();
    const Duration patience = Duration::seconds(parameters_.settle_timeout);
    if (arrived && now() - *arrived > patience) throw std::runtime_error{"an axis does not settle"};
    if (!done && now() - started > Duration::seconds(120.0) + patience)
      throw std::runtime_error{"an axis does not answer to `move`"};
  }
}

/// Mean of the next `count` readings that were taken after now.
Task Calibration::average_reading(std::int64_t count, double& mean) {
  sensing::DisplacementReading reading;
  while (reading_.take(reading)) {
  }
  const Instant after = now();
  double sum = 0.0;
  std::int64_t taken = 0;
  while (taken < count) {
    co_await NextStep{};
    while (taken < count && reading_.take(reading)) {
      if (reading.at().time_ns() < after.ns) continue;
      if (!reading.valid()) throw std::runtime_error{"the laser lost its beam"};
      sum += reading.displacement();
      ++taken;
    }
    if (now() - after > Duration::seconds(parameters_.settle_timeout))
      throw std::runtime_error{"no reading of the laser arrives"};
  }
  mean = sum / static_cast<double>(count);
}

Task Calibration::measure(const LineSpec& line, double interval, std::int64_t cycles, std::int64_t readings,
                          double share, recording::Table& table) {
  const Point from = point_of(line.from);
  const Point to = point_of(line.to);
  const double length = (to - from).norm();
  const auto intervals = std::max<std::int64_t>(1, std::llround(length / interval));
  co_await move_to(from, {});
  sensing::BeamCommand beam;
  beam.cell(cell);
  beam.at().time_ns(now().ns);
  beam.id(next_command_++);
  const Point direction = (to - from) / length;
  beam.beam_start({from.x(), from.y(), from.z()});
  beam.beam_direction({direction.x(), direction.y(), direction.z()});
  beam_.write(beam);
  for (int k = 0; k < 4; ++k) co_await NextStep{};  // the beam is aligned before the first reading
  const double begin = progress_;
  for (std::int64_t cycle = 0; cycle < cycles; ++cycle) {
    for (std::int64_t k = 0; k <= 2 * intervals + 1; ++k) {
      const bool forth = k <= intervals;
      const auto index = forth ? k : 2 * intervals + 1 - k;
      const Point target = from + (to - from) * (static_cast<double>(index) / static_cast<double>(intervals));
      co_await move_to(target, {});
      double mean = 0.0;
      co_await average_reading(readings, mean);
      append(table, line.name, target, mean, static_cast<double>(cycle + 1), forth ? 1.0 : -1.0);
      progress_ = begin + share *
                              (static_cast<double>(cycle) +
                               static_cast<double>(k) / static_cast<double>(2 * intervals + 2)) /
                              static_cast<double>(cycles);
    }
  }
  progress_ = begin + share;
  report(job::JOB_RUNNING, "measured line " + line.name);
}

Task Calibration::command_model(compensation::ModelCommandKind kind, const std::string& path) {
  compensation::ModelCommand command;
  command.cell(cell);
  command.at().time_ns(now().ns);
  command.id(static_cast<std::uint64_t>(id) << 32U | next_command_++);
  command.kind(kind);
  command.path(path);
  model_.write(command);
  const Instant give_up = now() + Duration::seconds(5.0);
  for (;;) {
    co_await NextStep{};
    const auto* status = model_status_.latest();
    if (status != nullptr && status->command_id() == command.id()) {
      if (status->state() == compensation::MODEL_REFUSED)
        throw std::runtime_error{"the compensation refused the model: " +
                                 std::string{status->text().c_str()}};
      co_return;
    }
    if (now() > give_up) throw std::runtime_error{"the compensation does not answer"};
  }
}

Calibration::Verification Calibration::evaluate(const recording::Table& table) const {
  Verification result;
  double sum = 0.0;
  Point start = Point::Zero();
  const auto& lines = table.columns[0].texts;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const Point here{table.columns[1].values[row], table.columns[2].values[row],
                     table.columns[3].values[row]};
    if (row == 0 || lines[row] != lines[row - 1]) start = here;
    const double error = table.columns[4].values[row] - (here - start).norm();
    result.maximum = std::max(result.maximum, std::abs(error));
    sum += error * error;
  }
  result.rms = std::sqrt(sum / static_cast<double>(table.rows()));
  return result;
}

Task Calibration::run(const GeometricJob& job) {
  co_await calibrate(job);
  progress_ = 1.0;
  report(job::JOB_DONE, "done");
}

Task Calibration::run(const PrintJob& job) {
  if (!job.first.empty()) {
    const auto first = std::find_if(parameters_.jobs.begin(), parameters_.jobs.end(),
                                    [&](const GeometricJob& other) { return other.name == job.first; });
    co_await calibrate(*first);
  }
  co_await printing_->run(job);
  progress_ = 1.0;
  report(job::JOB_DONE, "done");
}

Task Calibration::calibrate(const GeometricJob& job) {
  const std::filesystem::path folder = std::filesystem::absolute(job.out);
  std::filesystem::create_directories(folder);
  const double share = 1.0 / static_cast<double>(job.lines.size() + 2 * job.verify.size() + 1);
  co_await enable_axes();

  recording::Table before = lines_table();
  for (const LineSpec& line : job.verify)
    co_await measure(line, job.verify_interval, 1, job.readings, share, before);
  if (before.rows() > 0) before.write(folder / "verify_before.csv");

  recording::Table lines = lines_table();
  for (const LineSpec& line : job.lines)
    co_await measure(line, job.interval, job.cycles, job.readings, share, lines);
  lines.write(folder / "lines.csv");

  report(job::JOB_RUNNING, "identifying the error");
  const std::filesystem::path model = identify_geometric(job.machine, lines, folder);
  co_await command_model(compensation::MODEL_STAGE, model.string());
  co_await command_model(compensation::MODEL_ACTIVATE, model.string());
  progress_ += share;
  report(job::JOB_RUNNING, "compensation active; verifying");

  recording::Table after = lines_table();
  for (const LineSpec& line : job.verify)
    co_await measure(line, job.verify_interval, 1, job.readings, share, after);
  if (after.rows() > 0) {
    after.write(folder / "verify_after.csv");
    const Verification was = evaluate(before);
    const Verification is = evaluate(after);
    if (is.rms > was.rms) {
      co_await command_model(compensation::MODEL_ROLLBACK, model.string());
      throw std::runtime_error{
          "the compensation makes the error larger on lines that were not fitted; rolled back"};
    }
  }
}

}  // namespace invar::calibration
