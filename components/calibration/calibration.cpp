#include "components/calibration/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace invar::calibration {

namespace {

constexpr const char* letters[] = {"x", "y", "z"};

}  // namespace

Calibration::Calibration(const Parameters& parameters) : parameters_{parameters} {
  for (std::size_t i = 0; i < static_cast<std::size_t>(parameters.axes); ++i)
    axes_.push_back(std::make_unique<Axis>(*this, i));
  JobHost& host = *this;
  if (!parameters.prints.empty()) printing_ = std::make_unique<Printing>(*this, host);
  for (const std::string& zone : parameters.zones)
    zones_.push_back(std::make_unique<Input<thermal::NodeTemperature>>(
        *this, "temperature_" + zone, InputOptions{.optional = true, .profile = "state"}));
}

Calibration::~Calibration() = default;

void Calibration::activate() {
  transaction_ = 0;
  heat_.forget();
  heat_history_ = {};
  JobComponent::activate();
}

void Calibration::make_safe() {
  abandon_transaction();
  trace_ = nullptr;
  if (setpoint_before_) set_heater(*setpoint_before_);
  setpoint_before_.reset();
  for (std::size_t i = 0; i < axes_.size(); ++i) send(i, stage::AXIS_COMMAND_STOP);
  if (printing_) printing_->make_safe();
}

std::optional<JobComponent::Job> Calibration::find(const std::string& wanted) {
  if (const auto* job = named(parameters_.jobs, wanted)) return Job{run(*job), job->out};
  if (const auto* job = named(parameters_.thermal_jobs, wanted)) return Job{run(*job), job->out};
  if (const auto* job = named(parameters_.prints, wanted)) return Job{run(*job), job->out};
  return std::nullopt;
}

void Calibration::tend(bool job_runs) {
  follow_heat();
  if (job_runs) {
    watch_transaction();
    return;
  }
  sensing::DisplacementReading unused;
  while (reading_.take(unused)) {
  }
}

void Calibration::tell(const std::string& text, double progress) {
  progress_ = progress;
  report(job::JOB_RUNNING, text);
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

void Calibration::send(std::size_t axis, stage::AxisCommandKind kind, double position, const Pace& pace) {
  stage::AxisCommand command;
  stamp(command);
  command.axis(static_cast<std::uint32_t>(axis));
  command.id(next_id());
  command.kind(kind);
  command.position(position);
  command.velocity(pace.velocity > 0.0 ? pace.velocity : parameters_.velocity);
  command.acceleration(pace.acceleration);
  command.jerk(pace.jerk);
  axes_[axis]->last_command = command.id();
  axes_[axis]->loop.reset();
  axes_[axis]->link.reset();
  axes_[axis]->taken = false;
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
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      const auto* state = axes_[i]->state.latest();
      const bool tripped = state != nullptr && state->mode() == stage::AXIS_MODE_FAULT;
      if (tripped || (now() > give_up && (state == nullptr || !state->enabled())))
        throw std::runtime_error{
            AxisLink::not_enabled(axis_name(axes_[i]->state.topic, static_cast<std::int64_t>(i)), state)};
    }
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
      LoopWatch& loop = axes_[i]->loop;
      if (state != nullptr) {
        loop.take(*state);
        axes_[i]->link.look(axes_[i]->state.age(now()));
      }
      const bool answered = state != nullptr && state->command_id() == axes_[i]->last_command;
      const auto axis_said = [&] { return axis_name(axes_[i]->state.topic, static_cast<std::int64_t>(i)); };
      if (state != nullptr && state->mode() == stage::AXIS_MODE_FAULT)
        throw std::runtime_error{axis_said() + " tripped while moving" + loop.figures()};
      if (const auto fault = loop.fault(); fault && answered && state->command_done())
        throw std::runtime_error{axis_said() + ": " + *fault};
      if (answered && state->command_refused() && axes_[i]->taken)
        throw std::runtime_error{axes_[i]->link.stopped(axis_said(), name)};
      if (const auto fault = axes_[i]->link.fault(axis_said(), name)) throw std::runtime_error{*fault};
      axes_[i]->taken = axes_[i]->taken || answered;
      if (answered && state->command_refused())
        throw std::runtime_error{std::string{"axis "} + letters[i] + " refused to move to " +
                                 std::to_string(target[static_cast<Eigen::Index>(i)]) + " m"};
      done = done && answered && state->command_done();
      settled = settled && answered && state->settled();
    }
    if (done && settled) co_return;
    if (done && !arrived) arrived = now();
    const Duration patience = Duration::seconds(parameters_.settle_timeout);
    if (arrived && now() - *arrived > patience) {
      std::string which;
      for (std::size_t i = 0; i < axes_.size(); ++i)
        if (const auto* state = axes_[i]->state.latest(); state != nullptr && !state->settled())
          which += (which.empty() ? "" : ", ") +
                   axis_name(axes_[i]->state.topic, static_cast<std::int64_t>(i)) + axes_[i]->loop.figures();
      throw std::runtime_error{"an axis does not settle: " + which};
    }
    if (!done && now() - started > Duration::seconds(120.0) + patience)
      throw std::runtime_error{"an axis does not answer to `move`"};
  }
}

Task Calibration::wait(double seconds) {
  const Instant until = now() + Duration::seconds(seconds);
  while (now() < until) co_await NextStep{};
}

/// Aligns the laser's beam and zeroes it where the tool stands.
Task Calibration::align(Point from, Point to) {
  const Point direction = (to - from).normalized();
  sensing::BeamCommand beam;
  stamp(beam);
  beam.id(next_command_id());
  beam.beam_start({from.x(), from.y(), from.z()});
  beam.beam_direction({direction.x(), direction.y(), direction.z()});
  beam_.write(beam);
  for (int k = 0; k < 4; ++k) co_await NextStep{};  // the beam is aligned before the first reading
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

}  // namespace invar::calibration
