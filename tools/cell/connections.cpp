#include "tools/cell/connections.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/shown.hpp"
#include "core/component/port.hpp"
#include "core/config/yaml.hpp"
#include "core/dds/cell_client.hpp"
#include "core/dds/wire_type.hpp"
#include "idl/event.h"
#include "idl/standby.h"
#include "tools/cell/drives.hpp"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

namespace {

using config::Node;

std::vector<std::string> port_names(const Component& component) {
  std::vector<std::string> names;
  for (const Port* port : component.ports()) names.push_back(port->name());
  return names;
}

std::string type_of(const Port& port) {
  const dds::WireType* type = dds::WireTypes::all().find(port.type());
  return type == nullptr ? "a type without IDL" : type->name();
}

/// Every key of `connect`, `qos`, `publish` and `latency` must be a port of the component.
void check_port_keys(const LoadedComponent& member) {
  const auto names = port_names(*member.component);
  const auto check = [&](const char* section, std::optional<Port::Direction> only) {
    for (const Node& entry : member.file->node[section].map()) {
      const Port* found = member.component->find_port(entry.key());
      if (found == nullptr) {
        entry.fault("`" + clipped(entry.key()) + "` is no port of `" + member.file->type + "`",
                    config::mend_name(entry.key(), names));
      } else if (only == Port::Direction::output && found->direction() != only) {
        entry.fault("`" + entry.key() + "` is an input", "only outputs are published");
      } else if (only == Port::Direction::input && found->direction() != only) {
        entry.fault("`" + entry.key() + "` is no input whose latest sample counts",
                    "only such inputs have a latency");
      }
    }
  };
  check("connect", std::nullopt);
  check("qos", std::nullopt);
  check("publish", Port::Direction::output);
  // A component may have a parameter of that name, which is a number.
  if (!member.file->node["latency"].is_scalar()) check("latency", Port::Direction::input);
}

void connect_port(LoadedCell& loaded, const LoadedComponent& member, Port& port) {
  const auto& connections = member.file->connections;
  const auto found = connections.find(port.name());
  if (const auto qos = member.file->profiles.find(port.name()); qos != member.file->profiles.end())
    port.profile = qos->second;
  if (port.type() == typeid(standby::WarmState)) return;  // joined where two stand by for each other
  if (port.direction() != Port::Direction::input)
    port.topic = loaded.cell->topic(member.file->topics_of(), port.name());
  if (found == connections.end()) {
    if (port.type() == typeid(event::Notice) && port.direction() == Port::Direction::output)
      port.topic =
          dds::ServiceTopics{loaded.cell->name}.notices;  // what a component has to say, the cell says
    if (port.direction() == Port::Direction::input && !static_cast<InputPort&>(port).options().optional)
      member.file->node["connect"].fault(
          "input `" + port.name() + "` of `" + member.file->name + "` is not connected",
          "add `" + port.name() + ": component.port` to its `connect`");
    return;
  }
  const Node at = member.file->node["connect"][port.name()];
  if (!at.is_scalar()) return;  // read_cell has said so
  if (found->second.starts_with('/')) {
    port.topic = loaded.cell->topic(found->second);
    return;
  }
  const Port* other = named_port(loaded, found->second, at);
  if (other == nullptr) return;
  const bool writes = port.direction() == Port::Direction::output;
  // An inbox may hear what another one is told.
  const bool listens =
      port.direction() == Port::Direction::inbox && other->direction() == Port::Direction::inbox;
  if (writes && other->direction() != Port::Direction::inbox) {
    at.fault("`" + found->second + "` is no inbox, and an output is joined to inboxes only",
             "name the output in the `connect` of the component that reads it");
  } else if (!writes && !listens && other->direction() != Port::Direction::output) {
    at.fault("`" + found->second + "` is no output", "name the output that this port reads");
  } else if (found->second.substr(0, found->second.find('.')) == member.file->name &&
             port.direction() == Port::Direction::input) {
    at.fault("`" + found->second + "` is an output of the same component",
             "name the component that it shall hear");
  } else if (other->type() != port.type()) {
    at.fault("`" + found->second + "` carries " + type_of(*other) + ", but `" + port.name() + "` takes " +
                 type_of(port),
             "join ports of the same IDL type");
  } else {
    port.topic = loaded.cell->topic(found->second);
  }
}

/// Two outputs that command one inbox: two masters of one axis.
void check_owners(const LoadedCell& loaded) {
  std::map<std::string, std::string> owner;
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components)
      for (const auto& [port, target] : member.file->connections) {
        if (!member.component || member.file->standby || target.empty() || target.starts_with('/')) continue;
        const Port* output = member.component->find_port(port);
        if (output == nullptr || output->direction() != Port::Direction::output ||
            output->profile != "command")
          continue;
        const auto [known, added] = owner.emplace(target, member.file->name);
        if (!added)
          member.file->node["connect"][port].fault(
              "`" + target + "` is commanded by `" + known->second + "` already",
              "let one component command it, or give this output another profile by `qos`");
      }
}

/// Two components that want the same of the plant for themselves.
void check_claims(const LoadedCell& loaded) {
  struct Owner {
    std::string component;
    const config::CellProcess* process;
  };
  std::map<std::string, Owner> owner;
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components) {
      if (!member.component) continue;
      bool told = false;  // who takes another's device takes its connection, too
      for (const Component::Claim& claim : member.component->claims()) {
        const std::string pc = claim.of_this_pc ? process.file->host : "";
        const auto [known, added] =
            owner.emplace(pc + " " + claim.what, Owner{member.file->name, process.file});
        const Owner& first = known->second;
        if (added || (claim.shared_in_process && (told || first.process == process.file))) continue;
        // Of two that stand by for each other one alone commands; the connection is another matter.
        const bool stands_by = member.file->standby && member.file->standby_of == first.component;
        if (stands_by && !claim.shared_in_process) continue;
        told = true;
        if (stands_by) {
          (*member.file->standby)["of"].fault(
              "needs a connection of its own to the device of `" + first.component + "`",
              "say `several_masters: true` in `" + first.component + "` where the device allows it");
          continue;
        }
        const Node at = member.file->node;
        if (claim.shared_in_process) {
          (at.has(claim.parameter) ? at[claim.parameter] : at)
              .fault("takes " + claim.what + ", which `" + first.component + "` of process `" +
                         first.process->name + "` takes already",
                     "put both into one process, where they share it; or say `several_masters: true` where "
                     "the device allows it");
          continue;
        }
        (at.has(claim.parameter) ? at[claim.parameter] : at)
            .fault("takes " + claim.what + ", which is `" + first.component + "`'s already",
                   "give one of them another `" + claim.parameter + "`");
      }
    }
}

/// Components that cannot work at the rate at which they are stepped.
void check_rates(const LoadedCell& loaded) {
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components) {
      if (!member.component || !process.file->rate_known) continue;
      const Duration step = process.file->period * member.file->every;
      if (const auto unfit = member.component->unfit(step.in_seconds())) {
        const Node at = member.file->node;
        (at.has(unfit->parameter) ? at[unfit->parameter] : at).fault(unfit->why, unfit->mend);
      }
    }
}

/// How long it takes until the next sample of an output comes to another process.
Duration between_samples(const config::CellProcess& writer, const config::CellComponent& component,
                         const std::string& port) {
  const Duration step = writer.period * component.every;
  const auto rate = component.publish_rates.find(port);
  if (rate == component.publish_rates.end()) return step;
  return std::max(step, Duration::seconds(1.0 / rate->second));
}

/// A latency that is declared must be one that can be told, and kept.
void check_latencies(const LoadedCell& loaded) {
  for (const LoadedProcess& reader : loaded.processes)
    for (const LoadedComponent& member : reader.components)
      for (const auto& [name, latency] : member.file->latencies) {
        const Port* input = member.component ? member.component->find_port(name) : nullptr;
        if (input == nullptr || input->direction() != Port::Direction::input) continue;
        const Node at = member.file->node["latency"][name];
        if (const auto* type = dds::WireTypes::all().find(input->type());
            type == nullptr || !type->is_stamped()) {
          at.fault("`" + name + "` carries samples without a stamp, so that nobody can tell their age",
                   "leave the latency out, or add `at` to the type");
          continue;
        }
        const auto connection = member.file->connections.find(name);
        if (connection == member.file->connections.end()) {
          at.fault("`" + name + "` is not connected", "connect it, or leave its latency out");
          continue;
        }
        for (const LoadedProcess& writer : loaded.processes)
          for (const LoadedComponent& other : writer.components) {
            const std::string prefix = other.file->name + ".";
            // Within a process a sample may be of the very cycle that reads it.
            if (&writer == &reader || !connection->second.starts_with(prefix)) continue;
            if (!writer.file->rate_known) continue;
            const Duration period =
                between_samples(*writer.file, *other.file, connection->second.substr(prefix.size()));
            if (latency < period)
              at.fault("`" + connection->second + "` comes every " + milliseconds(period) +
                           " only, so that its sample gets older than " + milliseconds(latency) +
                           " before the next is there",
                       "raise the latency, or have it written or published more often");
          }
      }
}

/// The keys that an input's samples carry: those of the outputs of this cell that write its topic; of an inbox, of whoever
/// is told there.
void set_keys(LoadedCell& loaded) {
  const auto each_port = [&loaded](auto visit) {
    for (const LoadedProcess& process : loaded.processes)
      for (const LoadedComponent& member : process.components)
        if (member.component)
          for (Port* port : member.component->ports()) visit(*port);
  };
  const auto own_topic = [&loaded](const Port& port) {
    return loaded.cell->topic(port.owner().name, port.name());
  };
  each_port([&](Port& port) {
    if (port.direction() == Port::Direction::output || port.topic.empty()) return;
    auto& input = static_cast<InputPort&>(port);
    const bool has_axis = dds::WireTypes::all().find(port.type()) != nullptr &&
                          dds::WireTypes::all().find(port.type())->key_part() == "axis";
    input.keys.clear();
    input.is_of_plant = !port.topic.starts_with("cell/" + loaded.cell->name + "/");
    bool unknown = false, told = false;
    each_port([&](const Port& other) {
      const bool writes = other.direction() == Port::Direction::output && other.topic == port.topic;
      const bool is_told = other.direction() == Port::Direction::inbox && own_topic(other) == port.topic;
      if (!writes && !is_told) return;
      told = told || is_told;
      if (is_told && !has_axis) input.keys.push_back(0);  // nobody in particular: who listens there
      if (other.key || !has_axis)
        input.keys.push_back(other.key.value_or(other.owner().id));
      else
        unknown =
            true;  // of which axis its samples are, such as those of a plugin or of a job of several axes
    });
    if (unknown && !told) input.keys.clear();
  });
}

}  // namespace

Port* named_port(const LoadedCell& loaded, const std::string& connection, const Node& at) {
  const auto dot = connection.find('.');
  if (dot == std::string::npos) {
    at.fault("`" + clipped(connection) + "` names no port",
             "write `component.port`, or `/topic` for one of the plant");
    return nullptr;
  }
  const std::string component = connection.substr(0, dot);
  const std::string port = connection.substr(dot + 1);
  if (loaded.cell->find(component) == nullptr) {
    std::vector<std::string> names;
    for (const auto& process : loaded.cell->processes)
      for (const auto& candidate : process.components) names.push_back(candidate.name);
    at.fault("`" + clipped(component) + "` is no component of this cell",
             config::mend_name(component, names));
    return nullptr;
  }
  if (const auto* named = loaded.cell->find(component); named->standby) {
    at.fault("`" + component + "` stands by for `" + named->standby_of + "`",
             "name `" + named->standby_of + "." + port + "`, which is written by the one that leads");
    return nullptr;
  }
  Port* found = loaded.port(component, port);
  if (found == nullptr) {
    for (const LoadedProcess& process : loaded.processes)
      for (const LoadedComponent& member : process.components)
        if (member.file->name == component && member.component)
          at.fault("`" + component + "` has no port `" + clipped(port) + "`",
                   config::mend_name(port, port_names(*member.component)));
  }
  return found;
}

void connect_ports(LoadedCell& loaded) {
  for (LoadedProcess& process : loaded.processes)
    for (LoadedComponent& member : process.components) {
      if (!member.component) continue;
      check_port_keys(member);
      for (Port* port : member.component->ports()) connect_port(loaded, member, *port);
    }
  set_keys(loaded);
  check_owners(loaded);
  check_drives(loaded);
  check_claims(loaded);
  check_rates(loaded);
  check_latencies(loaded);
}

}  // namespace invar::tools
