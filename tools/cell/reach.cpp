#include "tools/cell/reach.hpp"

#include "components/calibration/axis_runner.hpp"
#include "components/stage/axis_stage.hpp"
#include "core/base/shown.hpp"

namespace invar::tools {

namespace {

/// The stage that takes commands from this topic, with its name; nullptr: none of this cell.
const LoadedComponent* stage_of(const LoadedCell& loaded, const std::string& topic) {
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components) {
      if (dynamic_cast<const stage::Stage*>(member.component.get()) == nullptr) continue;
      const Port* command = member.component->find_port("command");
      if (command != nullptr && command->topic == topic) return &member;
    }
  return nullptr;
}

void check(const LoadedComponent& member, const calibration::AxisRunner& runner,
           const LoadedComponent& moved) {
  const Range travel = dynamic_cast<const stage::Stage&>(*moved.component).travel();
  for (const calibration::Reach& reach : runner.reaches()) {
    const config::Node job = member.file->node[reach.list].list()[reach.place];
    if (reach.from == reach.to)
      job.fault("moves nowhere: it begins where it ends, at " + shown(reach.from) + " m",
                "let both ends differ");
    for (const double end : {reach.from, reach.to})
      if (!travel.contains(end))
        job.fault("leads to " + shown(end) + " m, outside the travel of `" + moved.file->name + "`",
                  "stay between " + shown(travel.lower) + " and " + shown(travel.upper) + " m");
  }
}

}  // namespace

void check_reach(const LoadedCell& loaded) {
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components) {
      const auto* runner = dynamic_cast<const calibration::AxisRunner*>(member.component.get());
      if (runner == nullptr) continue;
      const Port* command = member.component->find_port("command");
      if (command == nullptr || command->topic.empty()) continue;
      if (const LoadedComponent* moved = stage_of(loaded, command->topic)) check(member, *runner, *moved);
    }
}

}  // namespace invar::tools
