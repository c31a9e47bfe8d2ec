#include "tools/cell/drives.hpp"

#include <functional>
#include <string>
#include <typeindex>

#include "components/stage/axis_stage.hpp"

namespace invar::tools {

namespace {

using config::Node;

/// A port and whose it is.
struct Found {
  const LoadedComponent* member = nullptr;
  const Port* port = nullptr;
  explicit operator bool() const { return port != nullptr; }
  [[nodiscard]] std::string name() const { return member->file->name + "." + port->name(); }
};

void for_each(const LoadedCell& loaded,
              const std::function<void(const LoadedComponent&, const Port&)>& visit) {
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components)
      if (member.component)
        for (const Port* port : member.component->ports()) visit(member, *port);
}

/// "x" of "feedback_x"; what belongs together in one device has the same end.
std::string axis_of(const Port& port) {
  const auto at = port.name().rfind('_');
  return at == std::string::npos ? "" : port.name().substr(at + 1);
}

bool is_motor(const Port& port, Port::Direction direction) {
  return port.type() == typeid(stage::MotorCommand) && port.direction() == direction;
}

/// The motor input beside this feedback of a device; none: it has no such input.
Found motor_beside(const LoadedComponent& device, const Port& feedback) {
  for (const Port* port : device.component->ports())
    if (is_motor(*port, Port::Direction::input) && axis_of(*port) == axis_of(feedback))
      return {&device, port};
  return {};
}

/// The output of the cell behind a topic.
Found writer(const LoadedCell& loaded, const std::string& topic) {
  Found found;
  if (!topic.empty())
    for_each(loaded, [&](const LoadedComponent& member, const Port& port) {
      if (port.direction() == Port::Direction::output && port.topic == topic) found = {&member, &port};
    });
  return found;
}

/// Where the feedback of an axis comes from, back through filters that read one and write another.
Found source(const LoadedCell& loaded, Found feedback) {
  for (int hops = 0; feedback && hops < 8; ++hops) {
    if (motor_beside(*feedback.member, *feedback.port)) return feedback;
    Found before;
    for (const Port* port : feedback.member->component->ports())
      if (port->type() == typeid(stage::AxisFeedback) && port->direction() == Port::Direction::input)
        before = writer(loaded, port->topic);
    feedback = before;
  }
  return {};
}

/// The feedback of a device by which a stage knows its axis; none: it is the plant's.
Found feedback_of(const LoadedCell& loaded, const LoadedComponent& stage) {
  for (const Port* port : stage.component->ports())
    if (port->type() == typeid(stage::AxisFeedback) && port->direction() == Port::Direction::input)
      if (const Found device = source(loaded, writer(loaded, port->topic))) return device;
  return {};
}

void check_stage(const LoadedCell& loaded, const LoadedComponent& member, const Port& motor) {
  const Found feedback = feedback_of(loaded, member);
  if (!feedback) return;
  const Found wanted = motor_beside(*feedback.member, *feedback.port);
  if (wanted.port->topic == motor.topic) return;
  const std::string mine = member.file->name + "." + motor.name();
  const Node device = feedback.member->file->node;
  const Node at = device.has("connect") ? device["connect"] : device;
  const std::string mend =
      "`connect: {" + wanted.port->name() + ": " + mine + "}` in `" + feedback.member->file->name + "`";
  if (wanted.port->topic.empty()) {
    at.fault("`" + mine + "` moves nothing: `" + member.file->name + "` reads `" + feedback.name() +
                 "`, but `" + wanted.name() + "` is not connected",
             "add " + mend);
    return;
  }
  const Found mover = writer(loaded, wanted.port->topic);
  // A topic of the plant may be anybody's; two stages of one axis are told as such.
  if (!mover || feedback_of(loaded, *mover.member).port == feedback.port) return;
  at.fault("`" + wanted.name() + "` is moved by `" + mover.name() + "`, but `" + member.file->name +
               "` reads `" + feedback.name() + "`",
           "write " + mend + ", or have it read the axis that it moves");
}

}  // namespace

void check_drives(const LoadedCell& loaded) {
  for_each(loaded, [&](const LoadedComponent& member, const Port& port) {
    if (is_motor(port, Port::Direction::output)) check_stage(loaded, member, port);
  });
}

std::vector<Fault> unchecked(const LoadedCell& loaded) {
  std::vector<Fault> notes;
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components)
      if (const auto* stage = dynamic_cast<const stage::Stage*>(member.component.get());
          stage != nullptr && !stage->gains_can_be_checked()) {
        const Node node = member.file->node;
        notes.push_back(
            {(node.has("control") ? node["control"] : node).where(),
             "whether `" + member.file->name +
                 "` is unstable with its gains was not checked: mass and motor constant are not known",
             "give control.feedforward_acceleration (mass over motor constant), or `model`"});
      }
  return notes;
}

}  // namespace invar::tools
