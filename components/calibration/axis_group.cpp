#include "components/calibration/axis_group.hpp"

#include <optional>
#include <stdexcept>
#include <string>

namespace invar::calibration {

namespace {

constexpr std::int64_t numbers[] = {0, 1, 2};
constexpr const char* letters[] = {"x", "y", "z"};

}  // namespace

AxisGroup::AxisGroup(Component& owner, job::JobHost& host, const Settings& settings)
    : owner_{owner}, host_{host}, settings_{settings} {
  for (std::size_t i = 0; i < static_cast<std::size_t>(settings.axes); ++i) {
    const std::string letter = letters[i];
    axes_.push_back(std::make_unique<JobAxis>(owner, numbers[i], "state_" + letter, "command_" + letter));
  }
}

void AxisGroup::send(std::size_t axis, stage::AxisCommandKind kind, double position, const job::Pace& pace) {
  stage::AxisCommand command;
  command.kind(kind);
  command.position(position);
  command.velocity(pace.velocity > 0.0 ? pace.velocity : settings_.velocity);
  command.acceleration(pace.acceleration);
  command.jerk(pace.jerk);
  axes_[axis]->send(command, host_.next_id());
}

void AxisGroup::stop() {
  for (std::size_t i = 0; i < axes_.size(); ++i) send(i, stage::AXIS_COMMAND_STOP);
}

job::Task AxisGroup::enable() {
  std::vector<JobAxis*> all;
  for (const auto& axis : axes_) all.push_back(axis.get());
  CommandIds ids = [this] { return host_.next_id(); };
  co_await enable_axes(all, ids, Duration::seconds(10.0) + Duration::seconds(settings_.settle_timeout));
}

void AxisGroup::begin_move(const Eigen::Vector3d& target, const job::Pace& pace) {
  Eigen::Vector3d way = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < axes_.size(); ++i)
    if (const auto* state = axes_[i]->state.latest(); state != nullptr)
      way[static_cast<Eigen::Index>(i)] = target[static_cast<Eigen::Index>(i)] - state->setpoint_position();
  const Eigen::Vector3d share =
      way.norm() > 0.0 ? Eigen::Vector3d{way.cwiseAbs() / way.norm()} : Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    send(i, stage::AXIS_COMMAND_MOVE, target[k],
         {share[k] * pace.velocity, share[k] * pace.acceleration, share[k] * pace.jerk});
  }
}

/// The axes that have not settled, with the figures of their loops.
std::string AxisGroup::unsettled() const {
  std::string which;
  for (const auto& axis : axes_)
    if (const auto* state = axis->state.latest(); state != nullptr && !state->settled())
      which += (which.empty() ? "" : ", ") + axis->said() + axis->figures();
  return which;
}

job::Task AxisGroup::move_to(Eigen::Vector3d target, job::Pace pace) {
  begin_move(target, pace);
  std::optional<Instant> arrived;
  const Instant started = owner_.now();
  const Duration patience = Duration::seconds(settings_.settle_timeout);
  for (;;) {
    co_await job::NextStep{};
    bool done = true;
    bool settled = true;
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      const JobAxis::Motion motion =
          axes_[i]->follow(std::string{"axis "} + letters[i] + " refused to move to " +
                           std::to_string(target[static_cast<Eigen::Index>(i)]) + " m");
      done = done && motion.done;
      settled = settled && motion.settled;
    }
    if (done && settled) co_return;
    if (done && !arrived) arrived = owner_.now();
    if (arrived && owner_.now() - *arrived > patience)
      throw std::runtime_error{"an axis does not settle: " + unsettled()};
    if (!done && owner_.now() - started > Duration::seconds(120.0) + patience)
      throw std::runtime_error{"an axis does not answer to `move`"};
  }
}

}  // namespace invar::calibration
