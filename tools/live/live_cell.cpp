#include "tools/live/live_cell.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <set>

#include "core/dds/domain_ports.hpp"
#include "core/dds/middleware_log.hpp"
#include "core/dds/own_address.hpp"
#include "tools/host/own_host.hpp"
#include "tools/live/interrupt.hpp"
#include "tools/live/status_view.hpp"

namespace invar::tools {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t most_processes = 64;   // of a cell: on a peer of which no file tells how many it has
constexpr const char* tools_name = "tools";  // stands where a cell's name would in participants of commands
constexpr Duration look = Duration::milliseconds(5);
constexpr auto quiet =
    std::chrono::milliseconds{200};  // nobody new for so long: all that are there have been seen

/// Waits until `condition`, Ctrl-C or the end of patience.
template <class Condition>
bool wait_until(Duration patience, Condition condition) {
  const auto end = Clock::now() + std::chrono::nanoseconds{patience.ns};
  while (!condition()) {
    if (Clock::now() > end || !sleep_for(look)) return false;
  }
  return true;
}

/// "invar/<cell>/<process>" and "invar/<cell>/<process>/realtime".
std::string cell_of_participant(const std::string& name) {
  constexpr std::string_view prefix = "invar/";
  if (!name.starts_with(prefix)) return "";
  const auto end = name.find('/', prefix.size());
  if (end == std::string::npos) return "";
  const std::string cell = name.substr(prefix.size(), end - prefix.size());
  return cell == tools_name ? "" : cell;
}

std::set<std::string> cells_in(const dds::Snapshot& snapshot) {
  std::set<std::string> cells;
  for (const auto& participant : snapshot.participants)
    if (const auto cell = cell_of_participant(participant.name); !cell.empty()) cells.insert(cell);
  return cells;
}

/// The processes of a cell that take part; the one that keeps simulated time says no status.
std::set<std::string> processes_in(const dds::Snapshot& snapshot, const std::string& cell) {
  const std::string prefix = "invar/" + cell + "/";
  std::set<std::string> processes;
  for (const auto& participant : snapshot.participants) {
    if (!participant.name.starts_with(prefix)) continue;
    const std::string process = participant.name.substr(prefix.size());
    if (process != "launcher") processes.insert(process.substr(0, process.find('/')));
  }
  return processes;
}

/// The strongest of those whose key this user can read, or the one that is asked for.
dds::Identity identity_of(const config::CellSecurity& security, const std::string& as) {
  const dds::KeyFolder keys{security.keys};
  std::vector<std::pair<std::string, bool>> people;
  for (const auto& name : security.operators) people.emplace_back(name, true);
  for (const auto& name : security.viewers) people.emplace_back(name, false);
  std::string names;
  for (const auto& [name, may_command] : people) {
    names += (names.empty() ? "" : ", ") + name;
    const bool is_meant = as.empty() ? access(keys.key(name).c_str(), R_OK) == 0 : as == name;
    if (is_meant) return {keys, name, may_command};
  }
  if (!as.empty())
    throw InputError{"--as", "`" + as + "` is no operator and no viewer of this cell", "it has: " + names};
  throw InputError{security.keys.string(), "has no key of an operator or viewer that this user can read",
                   "`invar keys CELL` makes them for " + names +
                       "; bring `public` and the folder of one of them to this PC, for this user"};
}

}  // namespace

std::unique_ptr<config::Cell> read_structure(const std::filesystem::path& file) {
  const config::Yaml yaml = config::Yaml::load(file);
  auto cell = std::make_unique<config::Cell>(config::read_cell(yaml));
  for (const auto& process : cell->processes)
    for (const auto& component : process.components) component.node.accept_all();
  yaml.finish();
  return cell;
}

CellCall::CellCall(CLI::App& app, std::vector<Word> words)
    : command{"invar " +
              (app.get_parent() != nullptr && app.get_parent()->get_parent() != nullptr
                   ? app.get_parent()->get_name() + " "
                   : "") +
              app.get_name()},
      described_{std::move(words)},
      words_(described_.size() + 1) {
  app.add_option("CELL", words_[0], "the cell file; left out with --domain");
  for (std::size_t i = 0; i < described_.size(); ++i)
    app.add_option(described_[i].name, words_[i + 1], described_[i].help);
  app.add_option("--domain", domain, "the cell's DDS domain, instead of its file")->check(CLI::Range(0, 232));
  app.add_option("--cell", cell, "its name, where several cells share the domain");
  app.add_option("--address", addresses, "look only on this address of this PC, with --domain")
      ->allow_extra_args(false);
  app.add_option("--peer", peers, "address of a PC of the cell, with --domain, where multicast does not pass")
      ->allow_extra_args(false);
  app.add_option("--as", as, "in whose name, where the cell is secured (the first whose key can be read)");
  app.add_option("--wait", patience, "how long to wait for the cell [s] (5)")->check(CLI::Range(0.1, 3600.0));
}

void CellCall::resolve() {
  if (domain >= 0) {
    if (!words_.back().empty())
      throw InputError{command, "has one word too many", "leave the cell file out where --domain is given"};
    words_.pop_back();
  } else {
    if (words_[0].empty())
      throw InputError{command, "which cell is meant?", "name its cell file first, or give --domain"};
    file = words_[0];
    words_.erase(words_.begin());
  }
  for (std::size_t i = 0; i < described_.size(); ++i)
    if (described_[i].required && words_[i].empty())
      throw InputError{command, described_[i].name + " is missing", described_[i].help + "; see --help"};
}

LiveCell::LiveCell(const CellCall& call, Need need) : patience_{Duration::seconds(call.patience)} {
  dds::NodeOptions options;
  options.cell = tools_name;
  options.process = call.command;
  std::replace(options.process.begin(), options.process.end(), ' ', '-');
  options.addresses = call.addresses;
  // Commands come and go. Over shared memory, a process that did not get to run would find their last message with its memory
  // gone, and Fast DDS 2.9 never gets past such a message: nothing would reach that process any more.
  options.shared_memory = false;
  dds::Profiles profiles = dds::standard_profiles();
  if (!call.file.empty()) {
    cell_ = read_structure(call.file);
    options.domain = static_cast<std::uint32_t>(cell_->domain);
    if (options.addresses.empty()) {
      // None where this PC is no host of the cell: it looks on all of its networks then.
      const auto add = [&](const std::string& address) {
        if (dds::is_own_address(address) &&
            std::find(options.addresses.begin(), options.addresses.end(), address) == options.addresses.end())
          options.addresses.push_back(address);
      };
      for (const auto& host : cell_->hosts) add(host.address);
      options.may_come_later = true;  // a host that was cut off can look at itself
    }
    options.peers = peers_of(*cell_);
    if (cell_->security) options.identity = identity_of(*cell_->security, call.as);
    profiles = dds::load_profiles(cell_->profiles);
    for (const char* needed : {"state", "event", "request", "command"})
      if (!profiles.contains(needed))
        throw InputError{cell_->profiles.string(), std::string{"has no profile `"} + needed + "`",
                         "processes are watched by it: take it from the profiles that ship with Invar"};
  } else {
    options.domain = static_cast<std::uint32_t>(call.domain);
    for (const auto& peer : call.peers) options.peers.push_back({peer, most_processes});
  }
  where_ = "domain " + std::to_string(options.domain);
  ports_ = dds::DomainPorts{options.domain}.text();
  node_ = std::make_unique<dds::Node>(options, profiles);
  // A profiles file in the environment that Fast DDS does not understand shows here and nowhere else.
  (void)dds::newest_middleware_error();  // waits until all are said
  for (const auto& error : dds::take_middleware_errors())
    std::cerr << call.command << ": Fast DDS reports: " << error << '\n';
  if (cell_) {
    name_ = cell_->name;
  } else if (need == Need::nobody || !call.cell.empty()) {
    name_ = call.cell;
  } else {
    if (!wait_until(patience_, [&] { return !cells_in(node_->snapshot()).empty(); })) return;
    auto cells = cells_in(node_->snapshot());
    for (auto since = Clock::now(); Clock::now() - since < 2 * quiet && sleep_for(look);)
      if (const auto now = cells_in(node_->snapshot()); now != cells) {
        cells = now;
        since = Clock::now();
      }
    if (cells.size() > 1) {
      std::string list;
      for (const auto& cell : cells) list += (list.empty() ? "" : ", ") + cell;
      throw InputError{where_, "has several cells: " + list, "say which one with --cell"};
    }
    name_ = *cells.begin();
  }
  client_ = std::make_unique<dds::CellClient>(*node_, name_);
}

std::vector<std::string> not_heard(const config::Cell& cell,
                                   const std::vector<lifecycle::ProcessStatus>& heard) {
  std::vector<std::string> missing;
  for (const auto& process : cell.processes)
    if (std::none_of(heard.begin(), heard.end(),
                     [&](const auto& status) { return process.name == status.process_name().c_str(); }))
      missing.push_back(process.name);
  return missing;
}

std::vector<std::string> LiveCell::wait_for_processes() {
  std::vector<std::string> missing;
  const auto all_heard = [&] {
    missing = not_heard(*cell_, client_->processes());
    return missing.empty();
  };
  if (cell_) {
    wait_until(patience_, all_heard);
    return missing;
  }
  // Who takes part announces itself several times a second; its status is there when it is connected.
  std::set<std::string> known;
  auto since = Clock::now();
  wait_until(patience_, [&] {
    const auto now = processes_in(node_->snapshot(), name_);
    if (now != known) since = Clock::now();
    known = now;
    missing.assign(known.begin(), known.end());
    for (const auto& status : client_->processes()) std::erase(missing, status.process_name().c_str());
    return !known.empty() && missing.empty() && Clock::now() - since > quiet;
  });
  return missing;
}

void LiveCell::wait_for_restarts() {
  constexpr Duration start = Duration::milliseconds(1000);
  wait_until(std::min(start, patience_), [&] {
    const auto processes = client_->processes();
    return std::none_of(processes.begin(), processes.end(), [](const auto& p) { return p.pid() == 0; });
  });
}

bool LiveCell::knows_all(const dds::Snapshot& snapshot) const {
  if (!client_) return false;
  const auto statuses = client_->processes();
  if (cell_ && statuses.size() < cell_->processes.size()) return false;
  std::set<std::string> accounted;
  for (const auto& status : statuses) {
    const std::string name = "invar/" + name_ + "/" + status.process_name().c_str();
    const auto found =
        std::count_if(snapshot.endpoints.begin(), snapshot.endpoints.end(), [&](const dds::Endpoint& end) {
          return !end.is_local && (end.participant == name || end.participant == name + "/realtime");
        });
    if (found < status.endpoints()) return false;
    accounted.insert({name, name + "/realtime"});
  }
  return !statuses.empty() &&
         std::all_of(snapshot.participants.begin(), snapshot.participants.end(),
                     [&](const auto& participant) {
                       return accounted.contains(participant.name) ||
                              participant.name.starts_with(std::string{"invar/"} + tools_name + "/");
                     });
}

void LiveCell::settle() {
  constexpr std::chrono::seconds silence{3};
  std::size_t known = 0;
  auto since = Clock::now();
  wait_until(patience_, [&] {
    const auto snapshot = node_->snapshot();
    const std::size_t now = snapshot.participants.size() + snapshot.endpoints.size();
    if (now != known) since = Clock::now();
    known = now;
    return Clock::now() - since > silence || (knows_all(snapshot) && Clock::now() - since > quiet);
  });
}

std::string LiveCell::topic(const std::string& text) const {
  if (text.find('/') != std::string::npos) return text.front() == '/' ? text.substr(1) : text;
  const auto dot = text.find('.');
  if (dot == std::string::npos) return text;
  return dds::topic_name(name_, text.substr(0, dot), text.substr(dot + 1));
}

void LiveCell::wait_for_components() {
  wait_until(patience_, [&] {
    const auto components = client_->components();
    return std::none_of(components.begin(), components.end(),
                        [](const auto& c) { return is_inactive(c.state()); });
  });
}

bool LiveCell::wait_for_component(const std::string& component) {
  const auto is_up = [&] {
    const auto components = client_->components();
    return std::any_of(components.begin(), components.end(), [&](const auto& c) {
      return component == c.component_name().c_str() && !is_inactive(c.state());
    });
  };
  wait_until(patience_, is_up);
  return is_up();
}

std::vector<dds::Endpoint> LiveCell::wait_for_writers(const std::string& text) {
  const std::string wanted = topic(text);
  std::vector<dds::Endpoint> writers;
  wait_until(patience_, [&] {
    writers.clear();
    for (const auto& endpoint : node_->snapshot().endpoints)
      if (endpoint.topic == wanted && endpoint.is_writer && !endpoint.is_local) writers.push_back(endpoint);
    return !writers.empty();
  });
  return writers;
}

std::string LiveCell::process_of(const std::string& component) {
  if (cell_) {
    for (const auto& process : cell_->processes)
      for (const auto& candidate : process.components)
        if (candidate.name == component) return process.name;
    return "";
  }
  wait_until(patience_, [&] { return !client_->process_of(component).empty(); });
  return client_->process_of(component);
}

std::uint32_t LiveCell::cell_id() {
  if (cell_) return cell_->id;
  wait_until(patience_, [&] { return client_ && !client_->processes().empty(); });
  const auto processes = client_ ? client_->processes() : std::vector<lifecycle::ProcessStatus>{};
  return processes.empty() ? 0 : processes.front().cell();
}

std::string LiveCell::too_far_behind(const std::string& process) {
  if (!client_) return {};
  wait_until(patience_, [&] { return client_->clock_ahead(process).has_value(); });
  const auto ahead = client_->clock_ahead(process);
  const Duration lifespan = node_->profile("command").lifespan;
  if (!ahead || lifespan.ns <= 0 || *ahead > -lifespan) return {};
  return "not carried out: " + client_->clocks_apart(process) +
         ", or commands from here are taken for old ones";
}

std::string LiveCell::clocks_apart(const std::string& process) const {
  const std::string apart = client_ ? client_->clocks_apart(process) : "";
  return apart.empty() ? "" : "; " + apart;
}

void LiveCell::say_not_found(const std::string& command) const {
  if (client_ && !client_->processes().empty()) {
    std::cerr << command << ": the cell " << name_ << " runs, but no component of it answers to this\n";
    return;
  }
  std::string hosts;
  if (cell_)
    for (const auto& host : cell_->hosts)
      hosts += (hosts.empty() ? ", whose hosts are " : ", ") + host.address;
  std::cerr << command << ": no cell answers in " << where_ << hosts << " within " << patience_.in_seconds()
            << " s"
            << (cell_ && !is_secured() ? ""
                : cell_                ? ", in the name of " + node_->options().identity->name
                                       : " (a secured cell answers to a call with its file alone)")
            << "; this PC has " << dds::own_addresses_text()
            << ". Is it running, on one network with this PC, "
            << "and open to UDP " << ports_
            << " in the firewalls of both? (`invar doctor` looks; --wait gives a "
            << "busy one longer)\n";
}

dds::Profile reader_profile(const std::vector<dds::Endpoint>& writers, std::int64_t depth) {
  dds::Profile profile;
  profile.name = "watching";
  profile.depth = depth;
  profile.max_instances = 1000;
  profile.reliable = true;
  profile.durability = dds::Durability::transient_local;
  for (const auto& writer : writers) {
    profile.reliable = profile.reliable && writer.qos.reliable;
    profile.durability = std::min(profile.durability, writer.qos.durability);
    profile.exclusive = writer.qos.exclusive;
    profile.partitions = writer.qos.partitions;
    profile.representations = writer.qos.representations;
  }
  return profile;
}

bool is_service_topic(const std::string& topic) {
  return topic.find("/process/") != std::string::npos || topic.find("/lockstep/") != std::string::npos ||
         (topic.starts_with("cell/") &&
          std::count(topic.begin(), topic.end(), '/') == 2);  // heartbeat, clock
}

}  // namespace invar::tools
