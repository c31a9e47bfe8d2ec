#include "components/calibration/job_axis.hpp"

#include <stdexcept>
#include <utility>

namespace invar::calibration {

void JobAxis::send(stage::AxisCommand command, std::uint64_t id) {
  owner_.stamp(command);
  command.axis(static_cast<std::uint32_t>(number_));
  command.id(id);
  last_command_ = id;
  loop_.reset();
  link_.reset();
  taken_ = false;
  command_.write(command);
}

bool JobAxis::has_answered() {
  const auto* newest = state.latest();
  return newest != nullptr && newest->command_id() == last_command_;
}

JobAxis::Motion JobAxis::follow(const std::string& refused) {
  const auto* newest = state.latest();
  if (newest != nullptr) {
    loop_.take(*newest);
    link_.look(state.age(owner_.now()));
  }
  const bool answered = has_answered();
  if (newest != nullptr && newest->mode() == stage::AXIS_MODE_FAULT)
    throw std::runtime_error{said() + " tripped while moving" + loop_.figures()};
  if (const auto fault = loop_.fault(); fault && answered && newest->command_done())
    throw std::runtime_error{said() + ": " + *fault};
  if (answered && newest->command_refused() && taken_)
    throw std::runtime_error{link_.stopped(said(), owner_.name)};
  if (const auto fault = link_.fault(said(), owner_.name)) throw std::runtime_error{*fault};
  taken_ = taken_ || answered;
  if (answered && newest->command_refused()) throw std::runtime_error{refused};
  return {answered, answered && newest->command_done(), answered && newest->settled()};
}

namespace {

constexpr Duration ask_again = Duration::milliseconds(500);
constexpr Duration ask_refused_again = Duration::milliseconds(2000);  // each refusal is a notice of the stage

struct Asked {
  JobAxis* axis;
  Instant at;  // the newest request
  bool once = false;
};

/// True: asked now, or has to be waited for.
bool is_due(Asked& asked, Instant now) {
  if (!asked.once) return true;
  const bool refused = asked.axis->has_answered() && asked.axis->state.latest()->command_refused();
  return now - asked.at >= (refused ? ask_refused_again : ask_again);
}

}  // namespace

job::Task enable_axes(std::vector<JobAxis*> axes, CommandIds next_id, Duration patience) {
  std::vector<Asked> waiting;
  for (JobAxis* axis : axes) waiting.push_back({axis, {}});
  const auto now = [&] { return axes.front()->owner().now(); };
  const Instant give_up = now() + patience;
  stage::AxisCommand enable;
  enable.kind(stage::AXIS_COMMAND_ENABLE);
  while (!waiting.empty()) {
    for (Asked& asked : waiting) {
      if (!is_due(asked, now())) continue;
      asked.axis->send(enable, next_id());
      asked.at = now();
      asked.once = true;
    }
    co_await job::NextStep{};
    std::erase_if(waiting, [](const Asked& asked) {
      return asked.axis->has_answered() && asked.axis->state.latest()->enabled();
    });
    for (const Asked& asked : waiting) {
      const auto* state = asked.axis->state.latest();
      const bool tripped = state != nullptr && state->mode() == stage::AXIS_MODE_FAULT;
      if (tripped || now() > give_up)
        throw std::runtime_error{AxisLink::not_enabled(asked.axis->said(), state)};
    }
  }
}

}  // namespace invar::calibration
