#include "tools/cell/standbys.hpp"

#include <unistd.h>

#include <algorithm>

#include "core/base/shown.hpp"
#include "core/component/standby.hpp"
#include "idl/event.h"

namespace invar::tools {

namespace {

/// A component that stands by, or is stood by for, with its process.
struct Member {
  LoadedProcess* process = nullptr;
  LoadedComponent* component = nullptr;

  [[nodiscard]] Standby* standby() const {
    auto* redundant = dynamic_cast<Redundant*>(component->component.get());
    return redundant == nullptr ? nullptr : &redundant->standby();
  }
  [[nodiscard]] std::string words() const {
    return "`" + component->file->name + "` in process `" + process->file->name + "` on " +
           process->file->host;
  }
  [[nodiscard]] Duration period() const { return process->file->period * component->file->every; }
};

struct Two {
  Member leader, spare;
};

std::vector<Two> pairs(const LoadedCell& loaded) {
  std::vector<Two> found;
  auto& processes =
      const_cast<LoadedCell&>(loaded).processes;  // NOLINT: who asks with a constant cell changes nothing
  for (LoadedProcess& process : processes)
    for (LoadedComponent& spare : process.components) {
      if (!spare.file->standby || !spare.component) continue;
      for (LoadedProcess& other : processes)
        for (LoadedComponent& leader : other.components)
          if (leader.file->name == spare.file->standby_of && leader.component && !leader.file->standby)
            found.push_back({{&other, &leader}, {&process, &spare}});
    }
  return found;
}

/// A beat that is late by a quarter is no loss, and none of a fast loop is by 10 ms.
Duration deadline_of(const Two& two) {
  return two.spare.component->file->standby_deadline.value_or(
      std::max(Duration::milliseconds(10), two.leader.period() * 5 / 4));
}

void join(const LoadedCell& loaded, const Member& one, const Member& other, const Two& two) {
  const bool is_spare = one.component == two.spare.component;
  one.standby()->pair(
      {.other = other.words(),
       .other_process = other.process->file->name,
       .command = "`invar lifecycle CELL " + one.component->file->name + " activate` has it lead",
       .is_spare = is_spare,
       .deadline = deadline_of(two),
       .is_same_pc = one.process->file->host == other.process->file->host,
       .process = getpid()});
  const auto topic = [&](const Member& of) { return loaded.cell->topic(of.component->file->name, "warm"); };
  one.component->component->find_port("warm")->topic = topic(one);
  one.component->component->find_port("other")->topic = topic(other);
}

bool can_stand_by(const Two& two) {
  const config::Node at = (*two.spare.component->file->standby)["of"];
  const std::string& type = two.leader.component->file->type;
  if (two.leader.standby() == nullptr) {
    at.fault("`" + two.leader.component->file->name + "` is a `" + type +
                 "`, which hands over no state that another one could go on from",
             "leave `standby` out: `thermal` and `stage` have it");
    return false;
  }
  const auto* redundant = dynamic_cast<const Redundant*>(two.leader.component->component.get());
  if (const auto unfit = redundant->without_standby(); unfit) {
    at.fault("nobody can stand by for `" + two.leader.component->file->name + "`: " + unfit->why,
             unfit->mend);
    return false;
  }
  if (two.leader.process->file->rate_known && deadline_of(two) <= two.leader.period()) {
    (*two.spare.component->file->standby)["deadline"].fault(
        "is not above the period of " + milliseconds(two.leader.period()) + " in which the other shows life",
        "raise it, or leave it out");
    return false;
  }
  if (two.leader.process->file->host != two.spare.process->file->host)
    for (const Component::Claim& claim : two.leader.component->component->claims())
      if (claim.of_this_pc && !claim.shared_in_process) {
        at.fault("takes " + claim.what + ", which is on the PC of `" + two.leader.component->file->name +
                     "` alone",
                 "name the device by an address that both PCs reach");
        return false;
      }
  return true;
}

}  // namespace

void pair_standbys(LoadedCell& loaded) {
  for (const Two& two : pairs(loaded)) {
    if (!can_stand_by(two)) continue;
    join(loaded, two.leader, two.spare, two);
    join(loaded, two.spare, two.leader, two);
    two.spare.component->component->id = two.leader.component->component->id;  // its samples are the other's
  }
}

std::set<std::string> shared_topics(const LoadedCell& loaded) {
  std::set<std::string> topics;
  for (const Two& two : pairs(loaded))
    for (const Port* port : two.spare.component->component->ports())
      if (port->direction() == Port::Direction::output && port->type() != typeid(event::Notice) &&
          port->name() != "warm" && !port->topic.empty())
        topics.insert(port->topic);
  return topics;
}

bool has_partner_on_another_pc(const LoadedCell& loaded, const std::string& process) {
  const auto two_pcs = [](const Two& two) {
    return two.leader.process->file->host != two.spare.process->file->host;
  };
  for (const Two& two : pairs(loaded))
    if (two_pcs(two) &&
        (two.leader.process->file->name == process || two.spare.process->file->name == process))
      return true;
  return false;
}

void check_standbys(const LoadedCell& loaded) {
  for (const Two& two : pairs(loaded))
    for (const auto& [name, connection] : two.leader.component->file->connections) {
      const Port* port = two.leader.component->component->find_port(name);
      if (port == nullptr || port->direction() != Port::Direction::input) continue;
      const std::string source = connection.substr(0, connection.find('.'));
      for (const LoadedComponent& beside : two.leader.process->components)
        if (beside.file->name == source)
          (*two.spare.component->file->standby)["of"].fault(
              "its input `" + name + "` comes from `" + source + "`, which is in the process of `" +
                  two.leader.component->file->name + "` and is lost with it",
              "put `" + source + "` into a process of its own");
    }
}

}  // namespace invar::tools
