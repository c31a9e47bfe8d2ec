#include "core/config/cell.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <set>

#include "core/base/limits.hpp"
#include "core/base/name.hpp"
#include "core/base/shown.hpp"

namespace invar::config {

namespace {

/// Names become file names and bounded strings on the wire; those of cells and components stand in topics too, which must
/// not have a `-` (Cyclone DDS refuses to read them).
enum class In { topics, files };
void check_name(const Node& node, const std::string& name, In where) {
  const auto flaw = flaw_of_identifier(name, where == In::files ? "-" : "");
  if (flaw)
    node.fault("`" + clipped(name) + "` is no name: it " + flaw->what,
               flaw->mend + (where == In::files ? "" : ", since it stands in topics"));
}

void check_file(const Node& node, const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) return;
  if (error == std::errc::permission_denied)
    node.fault("file `" + path.string() + "` cannot be read",
               "check its permissions and those of its folder");
  else
    node.fault("file `" + path.string() + "` does not exist", "paths count from the cell file's folder");
}

/// Words of a command line of ssh: none begins with `-`, or holds what ssh or a shell would take for more than a name.
SshAccess read_ssh(const Node& node) {
  SshAccess ssh;
  if (!node.exists()) return ssh;
  ssh.port = static_cast<int>(node.integer("port", 1, 65535, 22));
  const auto word = [&](const char* key, std::string_view also) {
    const std::string text = node.text(key, "");
    const auto flaw =
        text.empty() ? std::nullopt : flaw_of_identifier(text.substr(0, longest_identifier), also);
    if (flaw) node[key].fault("`" + clipped(text) + "` " + flaw->what, flaw->mend);
    if (text.starts_with('-') || text.size() > 253)
      node[key].fault("`" + clipped(text) + "` is no name", "write it as 10.0.0.11 or stage-pc.plant");
    return text;
  };
  ssh.address = word("address", "-.");
  ssh.user = word("user", "-.");
  return ssh;
}

CellHost read_host(const Node& node) {
  CellHost host{node.key(), "", "", read_ssh(node["ssh"])};
  if (node.has("interface")) host.interface = node.text("interface");
  if (node.has("address") || !node.has("interface")) host.address = node.text("address");
  if (const std::string flaw = flaw_of_address(host.address); node.has("address") && !flaw.empty())
    node["address"].fault("`" + clipped(host.address) + "` " + flaw, "write it as 10.0.0.11");
  check_name(node, host.name, In::files);
  return host;
}

/// All but its name, process and rate is that of the one that it stands by for: `take_from_leaders`.
void read_standby(CellComponent& component) {
  const Node node = component.node;
  const Node standby = *(component.standby = node["standby"]);
  component.type = node.text("type", "");
  component.standby_of = standby.text("of");
  if (standby.has("deadline"))
    component.standby_deadline = Duration::seconds(standby["deadline"].as_number("s", {1e-3, 60.0}));
  for (const Node& other : node.map())
    if (const std::string key = other.key(); key != "type" && key != "standby" && key != "every") {
      other.accept_all();
      other.fault(
          "stands beside `standby`",
          "leave it out: a standby has the parameters and connections of the one that it stands by for");
    }
}

CellComponent read_component(const Node& node, std::uint32_t id) {
  const bool stands_by = node.has("standby");
  CellComponent component{node.key(), stands_by ? "" : node.text("type"), id, 1, {}, {}, {}, {}, node};
  check_name(node, component.name, In::topics);
  if (component.name == "all")
    node.fault("`all` is no name for a component: `invar lifecycle all` means every one", "choose another");
  component.every = node.integer("every", 1, 1'000'000, 1);
  if (stands_by) {
    read_standby(component);
    return component;
  }
  for (const Node& port : node["connect"].map()) component.connections[port.key()] = port.as_text();
  for (const Node& port : node["qos"].map()) component.profiles[port.key()] = port.as_text();
  for (const Node& port : node["publish"].map())
    component.publish_rates[port.key()] = port.as_number("Hz", {0.01, 20'000.0});
  if (!node["latency"].is_scalar())  // a component may have a parameter of that name
    for (const Node& port : node["latency"].map())
      component.latencies[port.key()] = Duration::seconds(port.as_number("s", {1e-5, 3600.0}));
  return component;
}

RealtimeRequest read_realtime(const Node& node) {
  RealtimeRequest request;
  request.priority = static_cast<int>(node.integer("priority", 0, 99, 0));
  if (node.has("cpu")) request.cpu = static_cast<int>(node["cpu"].as_integer(0, 1023));
  request.lock_memory = node.flag("lock_memory", false);
  request.require = node.flag("require", false);
  if (node.has("latency")) request.latency = Duration::seconds(node["latency"].as_number("s", {1e-6, 10.0}));
  return request;
}

void check_publish_rates(const CellComponent& component, const CellProcess& process) {
  if (!process.rate_known) return;
  const double steps = 1.0 / (process.period * component.every).in_seconds();
  for (const auto& [port, rate] : component.publish_rates)
    if (rate > steps * (1.0 + 1e-6))
      component.node["publish"][port].fault(
          "`" + shown(rate) + "` Hz is above the " + shown(steps) + " Hz at which the component is stepped",
          "lower it, or leave it out: every step is then published");
}

/// The period of a loop: `node` is the part that has its `rate`.
void read_rate(const Node& node, CellProcess& process) {
  const Range rates{0.1, 20'000.0};
  const std::size_t faults = node.fault_count();
  const double rate = node.number("rate", "Hz", rates);
  process.rate_known = node.is_map() && node.fault_count() == faults;
  process.period = Duration::seconds(1.0 / std::max(rate, rates.lower));
}

CellProcess read_process(const Node& node, const std::vector<CellHost>& hosts, std::uint32_t& next_id) {
  CellProcess process;
  process.name = node.key();
  process.where = node.where();
  check_name(node, process.name, In::files);
  process.host = hosts.size() == 1 ? node.text("host", hosts.front().name) : node.text("host");
  if (const Node realtime = node["realtime"]; realtime.exists()) {
    if (node.has("rate"))
      node["rate"].fault("stands beside `realtime`", "keep `realtime: {rate: ...}` alone");
    read_rate(realtime, process);  // first: of a scalar the message names the key that is asked for first
    process.realtime = read_realtime(realtime);
  } else {
    read_rate(node, process);
  }
  const std::string overrun = node.choice("overrun", {"skip", "degrade", "safe_stop"}, "skip");
  process.overrun = overrun == "degrade"     ? OverrunPolicy::degrade
                    : overrun == "safe_stop" ? OverrunPolicy::safe_stop
                                             : OverrunPolicy::skip;
  process.tolerate =
      node.integer("tolerate", 0, 1'000'000, process.overrun == OverrunPolicy::degrade ? 3 : 0);
  if (process.realtime && process.realtime->latency > process.period)
    node["realtime"]["latency"].fault("is above the loop's period of " + milliseconds(process.period) +
                                          ": a cycle that ends so late is an overrun already",
                                      "lower it to the period or less");
  const std::string late = node.choice("late", {"mark", "event", "safe_stop"}, "event");
  process.late = late == "mark"    ? LatePolicy::mark
                 : late == "event" ? LatePolicy::event
                                   : LatePolicy::safe_stop;
  const Node components = node.required("components");
  for (const Node& child : components.map()) process.components.push_back(read_component(child, next_id++));
  if (components.is_map() && process.components.empty())
    components.fault("has no components", "name at least one, or remove the process");
  for (const CellComponent& component : process.components) check_publish_rates(component, process);
  return process;
}

void check_identities(const Node& root, const Cell& cell) {
  std::set<std::string> names;
  for (const CellProcess& process : cell.processes) {
    const bool known = std::any_of(cell.hosts.begin(), cell.hosts.end(),
                                   [&](const CellHost& host) { return host.name == process.host; });
    if (!known && !process.host.empty() && !cell.hosts.empty()) {
      std::vector<std::string> hosts;
      for (const CellHost& host : cell.hosts) hosts.push_back(host.name);
      const std::string near = nearest(process.host, hosts);
      root["processes"][process.name]["host"].fault(
          "`" + clipped(process.host) + "` is no host of this cell",
          near.empty() ? "add it to `hosts`" : "did you mean `" + near + "`?");
    }
    for (const CellComponent& component : process.components)
      if (!names.insert(component.name).second)
        component.node.fault("component `" + component.name + "` stands twice in this cell",
                             "rename one of them");
  }
}

/// Why `standby` cannot stand by for `leader`; empty: it can.
Fault why_no_standby(const Cell& cell, const CellProcess& process, const CellComponent& standby,
                     const CellComponent* leader) {
  const std::string of = "`" + clipped(standby.standby_of) + "`";
  if (leader == nullptr) {
    std::vector<std::string> names;
    for (const CellProcess& each : cell.processes)
      for (const CellComponent& component : each.components) names.push_back(component.name);
    const std::string near = nearest(standby.standby_of, names);
    return {"", of + " is no component of this cell",
            near.empty() ? "name the component that it stands by for" : "did you mean `" + near + "`?"};
  }
  if (leader->standby) return {"", of + " stands by itself", "name the component that leads"};
  if (std::any_of(process.components.begin(), process.components.end(),
                  [&](const CellComponent& each) { return &each == leader; }))
    return {"", of + " is in the same process, and both would be lost with it",
            "put the standby into another process, best on another PC"};
  for (const CellProcess& each : cell.processes)
    for (const CellComponent& other : each.components)
      if (other.standby && other.standby_of == leader->name && other.id < standby.id)
        return {"", "`" + other.name + "` stands by for " + of + " already", "keep one of them"};
  if (!standby.type.empty() && standby.type != leader->type)
    return {"", "is a `" + clipped(standby.type) + "`, but " + of + " is a `" + clipped(leader->type) + "`",
            "leave `type` out: the standby has that of the other"};
  return {};
}

/// A standby is the one that it stands by for, in another process.
void take_from_leaders(Cell& cell) {
  for (CellProcess& process : cell.processes)
    for (CellComponent& standby : process.components) {
      if (!standby.standby) continue;
      const CellComponent* leader = cell.find(standby.standby_of);
      const Fault fault = why_no_standby(cell, process, standby, leader);
      if (!fault.what.empty()) (*standby.standby)["of"].fault(fault.what, fault.mend);
      if (leader == nullptr || leader->standby) continue;
      standby.type = leader->type;
      standby.connections = leader->connections;
      standby.profiles = leader->profiles;
      standby.publish_rates = leader->publish_rates;
      standby.latencies = leader->latencies;
      standby.node = leader->node;
      check_publish_rates(standby, process);
    }
}

/// Each process has a key, and each host one for its `invar run`.
void check_key_names(const Node& node, const Cell& cell) {
  std::set<std::string> taken{"authority", "public"};
  for (const CellProcess& process : cell.processes) taken.insert(process.name);
  if (cell.has_bridge) taken.insert(bridge_name);
  for (const CellHost& host : cell.hosts)
    if (!taken.insert(launcher_name(host.name)).second)
      node.fault("`" + launcher_name(host.name) + "` is the key of `invar run` on a host",
                 "rename the process");
  const auto check = [&](const std::string& name) {
    if (taken.contains(name))
      node.fault("`" + name + "` is a process or a folder of the keys already", "choose another name");
  };
  for (const std::string& name : cell.security->operators) check(name);
  for (const std::string& name : cell.security->viewers) check(name);
  for (const PlantProgram& program : cell.security->plant) check(program.name);
}

}  // namespace

std::string flaw_of_address(const std::string& address) {
  in_addr parsed{};
  if (inet_pton(AF_INET, address.c_str(), &parsed) != 1) return "is no IPv4 address";
  const auto first = ntohl(parsed.s_addr) >> 24U;
  return first != 0 && first < 224 ? "" : "is no address of one PC";
}

std::string launcher_name(const std::string& host) { return "launcher-" + host; }

std::string Cell::topic(const std::string& connection) const {
  if (connection.starts_with('/')) return connection.substr(1);
  const auto dot = connection.find('.');
  return dot == std::string::npos ? "" : topic(connection.substr(0, dot), connection.substr(dot + 1));
}

const CellComponent* Cell::find(const std::string& component) const {
  for (const CellProcess& process : processes)
    for (const CellComponent& candidate : process.components)
      if (candidate.name == component) return &candidate;
  return nullptr;
}

Cell read_cell(const Yaml& yaml) {
  const Node root = yaml.root();
  Cell cell;
  cell.file = yaml.file();
  (void)root.integer("invar_cell", 1, 1);
  cell.name = root.text("name");
  if (root.has("name")) check_name(root["name"], cell.name, In::topics);
  cell.id = static_cast<std::uint32_t>(root.integer("id", 1, 65535, 1));
  cell.domain = static_cast<int>(root.integer("domain", 0, 232, 0));
  cell.simulated_time = root.choice("time", {"real", "simulated"}, "real") == "simulated";
  cell.window = Duration::seconds(root.number("window", "s", Range{1e-3, 1.0}, 0.02));
  cell.shared_memory = root.flag("shared_memory", true);
  if (root.has("address_wait"))
    cell.address_wait = Duration::seconds(root.number("address_wait", "s", Range{0.0, 1e9}, 0.0));
  cell.clock_bound = Duration::seconds(root.number("clock_bound", "s", Range{1e-3, 1e9}, 60.0));
  const auto beside = [&](const Node& node) {
    std::filesystem::path path = node.as_text();
    if (path.is_relative()) path = cell.file.parent_path() / path;
    if (node.is_scalar()) check_file(node, path);
    return path;
  };
  const auto folder_beside = [&](const Node& node) {
    std::filesystem::path path = node.as_text();
    if (path.is_relative()) path = cell.file.parent_path() / path;
    if (node.is_scalar() && !std::filesystem::is_directory(path))
      node.fault("`" + clipped(node.as_text()) + "` is no folder",
                 "name a folder from which models may be loaded");
    else if (node.is_scalar() && !std::filesystem::canonical(path).has_relative_path())
      node.fault("`" + clipped(node.as_text()) + "` is the whole disk",
                 "name the folder that holds the models");
    return path;
  };
  if (root.required("profiles").exists()) cell.profiles = beside(root["profiles"]);
  for (const Node& plugin : root["plugins"].list()) cell.plugins.push_back(beside(plugin));
  for (const Node& folder : root["models"].list()) cell.models.push_back(folder_beside(folder));
  cell.has_bridge = root.has("bridge");
  const Node hosts = root["hosts"];
  for (const Node& host : hosts.map()) cell.hosts.push_back(read_host(host));
  if (hosts.is_map() && cell.hosts.empty())
    hosts.fault("has no hosts", "name at least one, or leave it out: the cell then stays on loopback");
  // Whoever wants a network says so: anybody on it can command an unsecured cell.
  if (!root.has("hosts")) cell.hosts.push_back({"pc", "127.0.0.1", ""});
  const Node processes = root.required("processes");
  std::uint32_t next_id = 1;
  std::size_t components = 0;
  for (const Node& process : processes.map()) components += process["components"].map().size();
  if (components > limits::cell_components) {
    processes.fault("hold " + std::to_string(components) + " components",
                    "keep at most " + std::to_string(limits::cell_components));
    yaml.finish();
  }
  for (const Node& process : processes.map())
    cell.processes.push_back(read_process(process, cell.hosts, next_id));
  constexpr std::size_t most_processes = 64;
  if (processes.is_map() && cell.processes.empty()) processes.fault("has no processes", "name at least one");
  if (cell.processes.size() > most_processes)
    processes.fault("has " + std::to_string(cell.processes.size()) + " processes",
                    "use at most " + std::to_string(most_processes) + ": several components fit in one");
  check_identities(root, cell);
  take_from_leaders(cell);
  if (const Node security = root["security"]; security.exists()) {
    cell.security = read_security(security, cell.file.parent_path());
    check_key_names(security, cell);
  }
  for (const Node& job : root["jobs"].map()) {
    cell.jobs[job.key()] = job.as_text();
    if (job.is_scalar() && cell.find(job.as_text()) == nullptr)
      job.fault("`" + clipped(job.as_text()) + "` is no component of this cell",
                "name the component that runs the job");
  }
  return cell;
}

}  // namespace invar::config
