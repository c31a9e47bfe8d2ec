#include "tools/deploy/deployment.hpp"

#include <signal.h>
#include <sys/utsname.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <future>
#include <map>
#include <memory>
#include <numeric>
#include <set>
#include <sstream>

#include "core/base/name.hpp"
#include "core/base/shown.hpp"
#include "tools/cell/load_cell.hpp"
#include "tools/deploy/archive.hpp"
#include "tools/deploy/host_keys.hpp"
#include "tools/deploy/scripts.hpp"
#include "tools/deploy/unit.hpp"
#include "tools/host/own_host.hpp"

namespace invar::tools {

namespace {

constexpr int releases_kept = 5;

std::string whole(double number) { return std::to_string(static_cast<long>(std::ceil(number))); }

std::string megabytes(std::uintmax_t bytes) {
  return shown(std::round(static_cast<double>(bytes) / 1e5) / 10.0) + " MB";
}

/// Why a call failed: the last line that was said, which is where programs say it.
std::string why(const Said& said) {
  if (said.status == 0) return "";
  std::istringstream lines{said.err};
  std::string last, line;
  while (std::getline(lines, line))
    if (!line.empty()) last = line;
  if (last.empty()) last = "status " + std::to_string(said.status) + " without a word";
  return (said.status == 255 ? "ssh: " : "") + printable(last);
}

/// The PCs of a cell, asked at the same time.
class Hosts {
 public:
  Hosts(const config::Cell& cell, const DeployOptions& options)
      : options_{options},
        home_{(options.prefix / cell.name).string()},
        unit_{unit_name(cell)},
        hosts_{remote_hosts(cell, options)},
        states_(hosts_.size()) {
    signal(SIGPIPE, SIG_IGN);  // a host that goes is a fault of that host
  }

  [[nodiscard]] const std::string& home() const { return home_; }
  [[nodiscard]] std::size_t size() const { return hosts_.size(); }
  [[nodiscard]] const RemoteHost& host(std::size_t i) const { return hosts_[i]; }
  [[nodiscard]] const HostState& state(std::size_t i) const { return states_[i]; }

  /// Each work says what failed; nothing: it went well.
  HostFaults on_each(const std::function<std::string(std::size_t)>& work) const {
    std::vector<std::future<std::string>> said;
    for (std::size_t i = 0; i < hosts_.size(); ++i)
      said.push_back(std::async(std::launch::async, [&work, i]() -> std::string {
        try {
          return work(i);
        } catch (const std::exception& error) {
          return error.what();
        }
      }));
    HostFaults faults;
    for (std::size_t i = 0; i < said.size(); ++i)
      if (const std::string fault = said[i].get(); !fault.empty())
        faults.push_back(hosts_[i].name + " (" + hosts_[i].address + "): " + fault);
    return faults;
  }

  [[nodiscard]] Said ask(std::size_t i, const std::string& script, std::vector<std::string> arguments,
                         const std::string& input = "") const {
    arguments.insert(arguments.begin(), home_);
    return call(hosts_[i], script, arguments, input);
  }

  /// What is there; `names`: contents of which the missing ones are told.
  HostFaults look(const std::string& names) {
    return on_each([&](std::size_t i) { return look(i, names); });
  }
  std::string look(std::size_t i, const std::string& names) {
    return read_state(i, ask(i, scripts::look, {service(), options_.user}, names));
  }
  /// Only which releases there are; nothing is made there.
  HostFaults read_states() {
    return on_each([&](std::size_t i) { return read_state(i, ask(i, scripts::state, {})); });
  }

  [[nodiscard]] bool all_have(const std::string& release) const {
    return std::all_of(states_.begin(), states_.end(),
                       [&](const HostState& state) { return state.current == release; });
  }
  /// A PC that has the release already goes on while others get it: where one PC was replaced, the rest of the cell need not stop.
  [[nodiscard]] bool goes_on(std::size_t i, const std::string& release) const {
    return states_[i].current == release && !all_have(release);
  }

  HostFaults check(const std::string& release) const {
    return on_each([&](std::size_t i) { return why(ask(i, scripts::check, {release})); });
  }

  /// Every PC stands ready with its hand on the link before the first one is told to go.
  HostFaults switch_over(const std::string& release, bool& switched) const {
    std::vector<std::unique_ptr<Remote>> calls(hosts_.size());
    HostFaults faults = on_each([&](std::size_t i) -> std::string {
      calls[i] = std::make_unique<Remote>(
          hosts_[i], scripts::switch_over,
          std::vector<std::string>{home_, release, states_[i].current, service(), unit_, hosts_[i].name,
                                   whole(options_.patience), verb(i, release)});
      return calls[i]->wait_for_line() ? "" : why(calls[i]->finish());
    });
    switched = faults.empty();
    if (!switched) return faults;
    for (auto& remote : calls) (void)remote->write("go\n");
    return on_each([&](std::size_t i) { return why(calls[i]->finish()); });
  }

  HostFaults restore(const std::string& release) const {
    return on_each([&](std::size_t i) {
      return why(ask(i, scripts::restore,
                     {states_[i].current, states_[i].previous, service(), unit_, hosts_[i].name,
                      whole(options_.patience), verb(i, release)}));
    });
  }

  HostFaults status() const {
    return on_each([&](std::size_t i) {
      const Said said = ask(i, scripts::status, {whole(options_.patience / 2.0)});
      return said.status == 0 ? "" : "the cell is not well: " + why(said) + told(said.out);
    });
  }

  void clean() const {
    (void)on_each(
        [&](std::size_t i) { return why(ask(i, scripts::clean, {std::to_string(releases_kept)})); });
  }

  [[nodiscard]] std::string service() const { return options_.service ? "systemd" : "none"; }
  [[nodiscard]] const std::string& unit() const { return unit_; }

 private:
  std::string read_state(std::size_t i, const Said& said) {
    states_[i] = {};
    std::istringstream lines{said.out};
    for (std::string key, value; lines >> key >> value;) {
      if (key == "machine") states_[i].machine = value;
      if (key == "current") states_[i].current = value;
      if (key == "previous") states_[i].previous = value;
      if (key == "missing") states_[i].missing.push_back(value);
    }
    return why(said);
  }
  [[nodiscard]] std::string verb(std::size_t i, const std::string& release) const {
    return goes_on(i, release) ? "start" : "restart";
  }
  static std::string told(const std::string& table) {
    return table.empty() ? "" : "\n" + printable_lines(table);
  }

  const DeployOptions& options_;
  std::string home_, unit_;
  std::vector<RemoteHost> hosts_;
  std::vector<HostState> states_;
};

/// Sends the contents that are missing, as one archive.
std::string send(const Hosts& hosts, std::size_t i, const Release& release) {
  std::set<std::string> missing{hosts.state(i).missing.begin(), hosts.state(i).missing.end()};
  Remote remote{hosts.host(i), scripts::receive, {hosts.home()}};
  for (const ReleaseFile& file : release.files) {
    if (missing.erase(file.stored()) == 0) continue;
    bool read = remote.write(tar_head(file.stored(), file.size)) && remote.write(file.text);
    std::ifstream stream{file.source, std::ios::binary};
    std::vector<char> part(1 << 16);
    for (std::uintmax_t left = file.source.empty() ? 0 : file.size; read && left > 0;) {
      const auto most = static_cast<std::streamsize>(std::min<std::uintmax_t>(left, part.size()));
      if (!stream.read(part.data(), most))
        return "`" + printable(file.source.string()) + "` was changed while it was sent; deploy again";
      read = remote.write(part.data(), static_cast<std::size_t>(most));
      left -= static_cast<std::uintmax_t>(most);
    }
    if (!read || !remote.write(tar_padding(file.size))) break;  // finish() says why
  }
  (void)remote.write(tar_end());
  return why(remote.finish());
}

/// What a PC lacks is sent, and the release made of it. A content that was damaged there is sent again, once.
std::string bring(Hosts& hosts, std::size_t i, const Release& release, const std::string& names) {
  for (int tries = 0;; ++tries) {
    if (!hosts.state(i).missing.empty())
      if (const std::string fault = send(hosts, i, release); !fault.empty()) return fault;
    const Said said = hosts.ask(i, scripts::stage, {release.name}, release.manifest);
    if (said.status != scripts::damaged) return why(said);
    if (tries > 0) return "files there are damaged again and again; look at its disk";
    if (const std::string fault = hosts.look(i, names); !fault.empty()) return fault;
  }
}

std::string names_of_contents(const Release& release) {
  std::string names;
  for (const ReleaseFile& file : release.files) names += file.stored() + "\n";
  return names;
}

std::uintmax_t missing_size(const Hosts& hosts, std::size_t i, const Release& release) {
  const auto& missing = hosts.state(i).missing;
  std::uintmax_t sum = 0;
  for (const ReleaseFile& file : release.files)
    if (std::find(missing.begin(), missing.end(), file.stored()) != missing.end()) sum += file.size;
  return sum;
}

HostFaults other_machines(const Hosts& hosts) {
  utsname own{};
  uname(&own);
  HostFaults faults;
  for (std::size_t i = 0; i < hosts.size(); ++i)
    if (hosts.state(i).machine != own.machine)
      faults.push_back(hosts.host(i).name + ": is a " + printable(hosts.state(i).machine) +
                       ", and this program is for " + own.machine + "; deploy from a PC of its kind");
  return faults;
}

/// Each PC gets the keys of its own names. `changed`: where some were others, the units that shall take them.
HostFaults bring_keys(const Hosts& hosts, const LoadedCell& loaded, const DeployOptions& options,
                      const Tell& tell, std::map<std::size_t, std::vector<std::string>>& changed) {
  std::vector<std::string> archives;
  for (std::size_t i = 0; i < hosts.size(); ++i) archives.push_back(keys_for(loaded, hosts.host(i).name));
  std::vector<Said> said(hosts.size());
  HostFaults faults = hosts.on_each([&](std::size_t i) -> std::string {
    if (archives[i].empty()) return "";
    said[i] = hosts.ask(i, scripts::receive_keys, {hosts.service(), options.user}, archives[i]);
    return why(said[i]);
  });
  for (std::size_t i = 0; i < hosts.size(); ++i) {
    const bool is_changed = said[i].out.find("changed ") != std::string::npos;
    if (is_changed) changed[i] = {hosts.unit()};
    if (said[i].out.find("changed bridge/certificate.pem") != std::string::npos)
      changed[i].push_back(bridge_unit_name(*loaded.cell));
    if (said[i].status != 0) continue;  // a fault tells it
    tell(hosts.host(i).name + ": " +
         (archives[i].empty() ? "its keys are not on this PC, and stay as they are there"
          : is_changed        ? "has other keys now"
                              : "has its keys"));
  }
  return faults;
}

/// Where the release stays, its processes take the keys that are others now; elsewhere they start with them.
HostFaults take_keys(const Hosts& hosts, const std::string& release,
                     const std::map<std::size_t, std::vector<std::string>>& changed) {
  return hosts.on_each([&](std::size_t i) -> std::string {
    const auto units = changed.find(i);
    if (units == changed.end() || hosts.state(i).current != release) return "";
    return why(hosts.ask(i, scripts::take_keys, units->second));
  });
}

/// From here on there is something to take back.
HostFaults make_current(Hosts& hosts, const std::string& release, const DeployOptions& options,
                        const Tell& tell) {
  bool switched = false;
  HostFaults faults = hosts.switch_over(release, switched);
  if (!switched) return faults;
  if (faults.empty() && options.service) {
    tell("started; waiting for the cell to be well");
    faults = hosts.status();
  }
  if (faults.empty()) return {};
  tell("failed: each PC gets back what it had");
  for (const std::string& fault : hosts.restore(release))
    faults.push_back(fault + " (while it was taken back)");
  return faults;
}

std::string seconds_since(std::chrono::steady_clock::time_point began) {
  const std::chrono::duration<double> gone = std::chrono::steady_clock::now() - began;
  return shown(std::round(gone.count() * 10.0) / 10.0) + " s";
}

std::string counted_hosts(const Hosts& hosts) {
  return std::to_string(hosts.size()) + (hosts.size() == 1 ? " PC" : " PCs");
}

/// Only the places of the hosts count: with a file that has other faults a cell can still be rolled back.
config::Cell hosts_of(const DeployOptions& options) {
  const config::Yaml yaml = config::Yaml::load(options.cell);
  config::Cell cell = config::read_cell(yaml);
  if (flaw_of_identifier(cell.name) || cell.hosts.empty()) yaml.finish();
  if (options.only.empty()) return cell;
  const auto is_other = [&](const config::CellHost& host) { return host.name != options.only; };
  if (std::all_of(cell.hosts.begin(), cell.hosts.end(), is_other)) throw unknown_host(cell, options.only);
  std::erase_if(cell.hosts, is_other);
  return cell;
}

}  // namespace

std::vector<RemoteHost> remote_hosts(const config::Cell& cell, const DeployOptions& options) {
  std::vector<RemoteHost> hosts;
  for (const config::CellHost& host : cell.hosts) {
    if (std::none_of(cell.processes.begin(), cell.processes.end(),
                     [&](const auto& process) { return process.host == host.name; }))
      continue;
    RemoteHost remote{.name = host.name,
                      .address = host.ssh.address.empty() ? host.address : host.ssh.address,
                      .port = options.ssh_port != 0 ? options.ssh_port : host.ssh.port,
                      .user = host.ssh.user,
                      .identity = options.identity,
                      .config = options.ssh_config};
    if (remote.address.empty())
      throw InputError{cell.file.string() + ": hosts." + host.name, "has no address by which ssh reaches it",
                       "add `ssh: {address: ...}`"};
    hosts.push_back(std::move(remote));
  }
  return hosts;
}

HostFaults deploy(const DeployOptions& options, const Tell& tell) {
  const auto began = std::chrono::steady_clock::now();
  (void)load_cell(options.cell);  // faults of the file, by its name as it was given
  // Once more from a relative path, so that a path that the file names absolutely is seen to be one.
  const LoadedCell loaded =
      load_cell(std::filesystem::absolute(options.cell).lexically_relative(std::filesystem::current_path()));
  Hosts hosts{*loaded.cell, options};
  const Release release =
      make_release(loaded, {.cell = options.cell, .home = hosts.home(), .user = options.user});
  tell("release " + release.name + ": " + std::to_string(release.files.size()) + " files, " +
       megabytes(release.size()));
  const std::string names = names_of_contents(release);
  if (HostFaults faults = hosts.look(names); !faults.empty()) return faults;
  if (HostFaults faults = other_machines(hosts); !faults.empty()) return faults;
  for (std::size_t i = 0; i < hosts.size(); ++i)
    tell(hosts.host(i).name + ": " + std::to_string(hosts.state(i).missing.size()) + " files to send, " +
         megabytes(missing_size(hosts, i, release)) + "; current " + hosts.state(i).current);
  if (HostFaults faults = hosts.on_each([&](std::size_t i) { return bring(hosts, i, release, names); });
      !faults.empty())
    return faults;
  if (HostFaults faults = hosts.check(release.name); !faults.empty()) return faults;
  tell("whole and checked on " + counted_hosts(hosts) + " after " + seconds_since(began));
  std::map<std::size_t, std::vector<std::string>> other_keys;
  HostFaults faults;
  if (loaded.cell->security) faults = bring_keys(hosts, loaded, options, tell, other_keys);
  // Where one refuses its keys, the others take theirs: the next call would find them unchanged.
  if (options.service)
    for (std::string& fault : take_keys(hosts, release.name, other_keys)) faults.push_back(std::move(fault));
  if (!faults.empty()) return faults;
  if (hosts.all_have(release.name) && (!options.service || hosts.status().empty())) {
    tell("it is current on all of them already");
    return {};
  }
  if (faults = make_current(hosts, release.name, options, tell); !faults.empty()) return faults;
  hosts.clean();
  tell("release " + release.name + " is current on " + counted_hosts(hosts) + ", after " +
       seconds_since(began));
  return {};
}

HostFaults roll_back(const DeployOptions& options, const Tell& tell) {
  const auto began = std::chrono::steady_clock::now();
  Hosts hosts{hosts_of(options), options};
  if (HostFaults faults = hosts.read_states(); !faults.empty()) return faults;
  HostFaults faults;
  const std::string release = hosts.state(0).previous;
  for (std::size_t i = 0; i < hosts.size(); ++i)
    if (hosts.state(i).previous == "-" || hosts.state(i).previous != release)
      faults.push_back(hosts.host(i).name + ": the release before is " + hosts.state(i).previous +
                       (release == hosts.state(i).previous ? ": there is none to go back to"
                                                           : ", on " + hosts.host(0).name + " " + release +
                                                                 "; deploy the release that all shall have"));
  if (!faults.empty()) return faults;
  if (faults = hosts.check(release); !faults.empty()) return faults;
  if (faults = make_current(hosts, release, options, tell); !faults.empty()) return faults;
  tell("release " + release + " is current again on " + counted_hosts(hosts) + ", after " +
       seconds_since(began));
  return {};
}

HostFaults back_up(const DeployOptions& options, std::string& bytes) {
  Hosts hosts{hosts_of(options), options};
  std::vector<ArchiveFile> parts(hosts.size());
  HostFaults faults = hosts.on_each([&](std::size_t i) {
    Said said = hosts.ask(i, scripts::backup, {});
    parts[i] = {hosts.host(i).name + ".tar", std::move(said.out)};
    if (said.status == 0) (void)read_archive(parts[i].content, hosts.host(i).name);
    return why(said);
  });
  if (faults.empty()) bytes = archive_of(parts);
  return faults;
}

HostFaults restore_backups(const DeployOptions& options, const std::string& bytes, const std::string& where,
                           const Tell& tell) {
  Hosts hosts{hosts_of(options), options};
  std::map<std::string, std::string> parts;
  for (ArchiveFile& part : read_archive(bytes, where)) parts[part.path] = std::move(part.content);
  const auto ask = [&](const std::string& dry) {
    return hosts.on_each([&](std::size_t i) -> std::string {
      const auto part = parts.find(hosts.host(i).name + ".tar");
      if (part == parts.end()) return "the backup has nothing of this PC";
      return why(hosts.ask(i, scripts::restore_backup, {hosts.service(), hosts.unit(), dry}, part->second));
    });
  };
  if (HostFaults faults = ask("yes"); !faults.empty()) return faults;
  if (HostFaults faults = ask("no"); !faults.empty()) return faults;
  tell("restored on " + counted_hosts(hosts));
  return {};
}

HostFaults show(const DeployOptions& options, const Tell& tell) {
  Hosts hosts{hosts_of(options), options};
  HostFaults faults = hosts.read_states();
  for (std::size_t i = 0; i < hosts.size(); ++i)
    tell(hosts.host(i).name + ": current " + hosts.state(i).current + ", before " + hosts.state(i).previous);
  return faults;
}

}  // namespace invar::tools
