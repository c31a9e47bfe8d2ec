#include "tools/keys/rights.hpp"

#include <algorithm>

#include "components/recorder/recorder.hpp"
#include "components/supervisor/supervisor.hpp"
#include "core/base/fault.hpp"
#include "core/base/shown.hpp"
#include "core/dds/cell_client.hpp"
#include "core/dds/identity.hpp"
#include "core/dds/node.hpp"
#include "core/job/job_component.hpp"
#include "tools/cell/bridge_file.hpp"
#include "tools/cell/standbys.hpp"

namespace invar::tools {

namespace {

template <class Kind>
bool has(const LoadedProcess& process) {
  return std::any_of(process.components.begin(), process.components.end(), [](const LoadedComponent& member) {
    return dynamic_cast<const Kind*>(member.component.get()) != nullptr;
  });
}

/// A `*` in a topic's name would mean many.
const std::string& checked(const std::string& topic) {
  if (topic.find_first_of("*?[]") != std::string::npos)
    throw InputError{"topic `" + clipped(topic) + "`",
                     "has a character that means many topics in a permission", "give the topic another name"};
  return topic;
}

std::string lockstep(const config::Cell& cell, const std::string& what) {
  return "cell/" + cell.name + "/lockstep/" + what;
}

/// What every process says of itself, and hears from others.
void add_service(const config::Cell& cell, Rights& rights) {
  const dds::ServiceTopics topics{cell.name};
  rights.writes.insert({topics.process_status, topics.component_status, topics.notices,
                        topics.lifecycle_reply, topics.parameter_reply, topics.model_reply,
                        lockstep(cell, "reached"), dds::clock_topic(cell.name)});
  rights.reads.insert({topics.lifecycle_request, topics.parameter_request, topics.model_request,
                       lockstep(cell, "grant"), dds::heartbeat_topic(cell.name),
                       dds::clock_topic(cell.name)});
}

/// What a program must read that asks others.
void add_client(const config::Cell& cell, Rights& rights) {
  const dds::ServiceTopics topics{cell.name};
  rights.reads.insert({topics.process_status, topics.component_status, topics.notices, topics.lifecycle_reply,
                       topics.parameter_reply, topics.model_reply});
}

void add_requests(const config::Cell& cell, Rights& rights) {
  const dds::ServiceTopics topics{cell.name};
  rights.writes.insert({topics.lifecycle_request, topics.parameter_request, topics.model_request});
}

template <class Visit>
void each_port(const LoadedProcess& process, Visit visit) {
  for (const LoadedComponent& member : process.components)
    if (member.component)
      for (const Port* port : member.component->ports())
        if (!port->topic.empty()) visit(*port);
}

Rights of_process(const LoadedCell& loaded, const LoadedProcess& process) {
  const config::Cell& cell = *loaded.cell;
  Rights rights{process.file->name, Role::process, {}, {}};
  add_service(cell, rights);
  each_port(process, [&](const Port& port) {
    const bool writes = port.direction() == Port::Direction::output;
    (writes ? rights.writes : rights.reads).insert(checked(port.topic));
    if (writes && port.profile == "command") rights.writes.insert(dds::heartbeat_topic(cell.name));
  });
  if (has_partner_on_another_pc(loaded, process.file->name))  // it hears there that the other's process ended
    rights.reads.insert(dds::ServiceTopics{cell.name}.process_status);
  if (has_supervisor(process) || has<job::JobComponent>(process)) add_client(cell, rights);
  if (has_supervisor(process)) add_requests(cell, rights);
  // It brings the model that it found to a component on another PC.
  if (has<job::JobComponent>(process)) rights.writes.insert(dds::ServiceTopics{cell.name}.model_request);
  return rights;
}

/// All that the cell says, and the plant's topics that it is joined to.
void add_all_topics(const LoadedCell& loaded, Rights& rights) {
  rights.reads.insert("cell/" + loaded.cell->name + "/*");
  for (const LoadedProcess& process : loaded.processes)
    each_port(process, [&](const Port& port) { rights.reads.insert(checked(port.topic)); });
}

Rights of_person(const LoadedCell& loaded, const std::string& name, Role role) {
  Rights rights{name, role, {}, {}};
  add_all_topics(loaded, rights);
  if (role != Role::operator_) return rights;
  add_requests(*loaded.cell, rights);
  for (const LoadedProcess& process : loaded.processes)
    each_port(process, [&](const Port& port) {
      if (port.direction() == Port::Direction::inbox) rights.writes.insert(checked(port.topic));
    });
  return rights;
}

Rights of_launcher(const config::Cell& cell, const std::string& host) {
  Rights rights{config::launcher_name(host), Role::launcher, {}, {}};
  const dds::ServiceTopics topics{cell.name};
  rights.writes.insert({topics.process_status, topics.notices, lockstep(cell, "grant")});
  rights.reads.insert(lockstep(cell, "reached"));
  return rights;
}

/// The cell's end of each line, in its direction alone.
Rights of_bridge(const LoadedCell& loaded) {
  Rights rights{config::bridge_name, Role::bridge, {}, {}};
  for (const BridgeLine& line : read_bridge(loaded).lines)
    (line.direction == Direction::out ? rights.reads : rights.writes).insert(checked(line.cell_topic));
  rights.reads.insert(dds::clock_topic(loaded.cell->name));
  rights.writes.insert(dds::clock_topic(loaded.cell->name));
  return rights;
}

Rights of_program(LoadedCell& loaded, const config::PlantProgram& program) {
  Rights rights{program.name, Role::plant, {}, {}};
  const auto add = [&](const std::vector<std::string>& connections, std::set<std::string>& topics) {
    for (const std::string& connection : connections) {
      const std::string topic = loaded.cell->topic(connection);
      const auto dot = connection.find('.');
      const bool is_port = !connection.starts_with('/');
      if (is_port && (dot == std::string::npos ||
                      loaded.port(connection.substr(0, dot), connection.substr(dot + 1)) == nullptr))
        throw InputError{loaded.cell->file.string() + ": security.plant." + program.name,
                         "`" + clipped(connection) + "` is no port of this cell",
                         "write `component.port`, or `/topic` for one of the plant"};
      topics.insert(checked(topic));
    }
  };
  add(program.reads, rights.reads);
  add(program.writes, rights.writes);
  return rights;
}

Rights second_of(const LoadedCell& loaded, const Rights& first) {
  Rights rights{dds::second_name(first.name), first.role, {}, {}};
  add_all_topics(loaded, rights);
  return rights;
}

}  // namespace

std::string text_of(Role role) {
  switch (role) {
    case Role::process:
      return "process";
    case Role::launcher:
      return "launcher";
    case Role::bridge:
      return "bridge";
    case Role::operator_:
      return "operator";
    case Role::viewer:
      return "viewer";
    case Role::plant:
      return "plant";
  }
  return {};
}

bool has_supervisor(const LoadedProcess& process) { return has<supervisor::Supervisor>(process); }
bool has_recorder(const LoadedProcess& process) { return has<recorder::Recorder>(process); }

std::vector<Rights> rights_of(LoadedCell& loaded) {
  const config::CellSecurity security = loaded.cell->security.value_or(config::CellSecurity{});
  std::vector<Rights> all;
  for (const LoadedProcess& process : loaded.processes) {
    all.push_back(of_process(loaded, process));
    if (has_recorder(process)) all.push_back(second_of(loaded, all.back()));
  }
  for (const auto& host : loaded.cell->hosts) all.push_back(of_launcher(*loaded.cell, host.name));
  if (loaded.cell->has_bridge) all.push_back(of_bridge(loaded));
  const auto add_people = [&](const std::vector<std::string>& names, Role role) {
    for (const std::string& name : names) {
      all.push_back(of_person(loaded, name, role));
      all.push_back(second_of(loaded, all.back()));
    }
  };
  add_people(security.operators, Role::operator_);
  add_people(security.viewers, Role::viewer);
  for (const auto& program : security.plant) all.push_back(of_program(loaded, program));
  return all;
}

}  // namespace invar::tools
