#include "tools/deploy/unit.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "core/base/name.hpp"
#include "core/base/shown.hpp"
#include "core/config/yaml.hpp"
#include "tools/cell/bridge_file.hpp"

namespace invar::tools {

namespace {

bool is_plain(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
         std::string_view{"/._-+:@,="}.find(c) != std::string_view::npos;
}

/// Letters as they are; `%` begins a specifier everywhere in a unit.
std::string escaped(const std::string& text, bool variables) {
  std::string out;
  for (const char c : text) {
    if (c == '%' || (c == '$' && variables)) out += c;
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

/// A path that a line of a unit can hold at all.
void check_path(const std::string& what, const std::filesystem::path& path) {
  if (!path.is_absolute())
    throw InputError{what, "`" + printable(path.string()) + "` is no absolute path", "begin it with /"};
  if (const auto flaw = flaw_of_label(path.string(), 4000))
    throw InputError{what, "`" + printable(path.string()) + "` " + flaw->what, flaw->mend};
}

/// Rights and times that the processes of a host need together.
struct Needs {
  int priority = 0;
  bool lock_memory = false;
  double slowest = 0.0;  // period of a loop [s]
};

Needs needs_of(const config::Cell& cell, const std::string& host) {
  Needs needs;
  for (const config::CellProcess& process : cell.processes) {
    if (process.host != host) continue;
    needs.slowest = std::max(needs.slowest, process.period.in_seconds());
    if (!process.realtime) continue;
    needs.priority = std::max(needs.priority, process.realtime->priority);
    needs.lock_memory = needs.lock_memory || process.realtime->lock_memory;
  }
  return needs;
}

void check_host(const config::Cell& cell, const std::string& host) {
  std::vector<std::string> names;
  for (const config::CellHost& each : cell.hosts) names.push_back(each.name);
  if (std::find(names.begin(), names.end(), host) == names.end())
    throw InputError{cell.file.string() + ": hosts", "`" + printable(host) + "` is no host of this cell",
                     config::mend_name(host, names)};
  if (std::none_of(cell.processes.begin(), cell.processes.end(),
                   [&](const auto& process) { return process.host == host; }))
    throw InputError{cell.file.string() + ": processes", "none runs on the host `" + host + "`",
                     "name another host, or give it a process"};
}

/// Folders outside `data` in which components of the host write: absolute `out` and `state` of the file.
std::set<std::string> written_elsewhere(const LoadedCell& loaded, const std::string& host) {
  std::set<std::string> folders;
  for (const LoadedProcess& process : loaded.processes)
    for (const LoadedComponent& member : process.components)
      for (const ParameterInfo& info : member.prepared.infos) {
        const std::string name = info.path.substr(info.path.find_last_of('.') + 1);
        const std::filesystem::path folder = info.otherwise;
        if (process.file->host == host && (name == "out" || name == "state") && folder.is_absolute())
          folders.insert(folder.string());
      }
  return folders;
}

/// What the service may do. Devices, sockets and /dev/shm stay open to it, and /proc shows it the processes of other users: a
/// commander of this PC counts as lost when its process is not there. Root's rights, other files and other kernel interfaces
/// are closed. Real time comes by the two limits, which need no capability.
constexpr const char* confinement =
    "NoNewPrivileges=yes\n"
    "CapabilityBoundingSet=\n"
    "ProtectSystem=strict\n"
    "ProtectHome=read-only\n"
    "PrivateTmp=yes\n"
    "ProtectClock=yes\n"
    "ProtectHostname=yes\n"
    "ProtectKernelTunables=yes\n"
    "ProtectKernelModules=yes\n"
    "ProtectKernelLogs=yes\n"
    "ProtectControlGroups=yes\n"
    "LockPersonality=yes\n"
    "MemoryDenyWriteExecute=yes\n"
    "RestrictNamespaces=yes\n"
    "RestrictSUIDSGID=yes\n"
    "RemoveIPC=no\n"
    "RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK\n"
    "SystemCallArchitectures=native\n"
    "SystemCallFilter=@system-service\n"
    "SystemCallErrorNumber=EPERM\n"
    "UMask=0027\n";

void check(const config::Cell& cell, const UnitPaths& paths, const UnitOptions& options) {
  check_host(cell, options.host);
  if (const auto flaw = flaw_of_identifier(options.user, "-"))
    throw InputError{"--user", "`" + printable(options.user) + "` is no user: it " + flaw->what, flaw->mend};
  check_path("the program", paths.program);
  check_path("the cell file", paths.cell);
  check_path("the folder of the data", paths.data);
  if (paths.data.string().find_first_of("\\ \"'") != std::string::npos)
    throw InputError{"the folder of the data",
                     "`" + paths.data.string() + "` has a blank, quote or backslash",
                     "choose another folder"};
  if (!paths.libraries.empty()) check_path("the folder of the libraries", paths.libraries);
}

/// To the program of ExecStart; `after`: further units.
void begin(std::ostream& unit, const std::string& what, const std::string& after, const config::Cell& cell,
           const UnitPaths& paths, const UnitOptions& options) {
  unit << "# Written by `invar units` of version " INVAR_VERSION "; written anew by each `invar deploy`.\n"
       << "[Unit]\nDescription=Invar cell " << cell.name << ", " << what
       << "\nWants=network-online.target\nAfter=network-online.target time-sync.target" << after
       << "\n# Restarts are bounded in rate, and never given up.\nStartLimitIntervalSec=0\n\n[Service]\n"
       << "Type=notify\nNotifyAccess=main\nUser=" << options.user << "\nGroup=" << options.user
       << "\nWorkingDirectory=" << path_value(paths.data.string())
       << "\nExecStart=" << command_word(paths.program.string());
}

void environment_and_restarts(std::ostream& unit, const UnitPaths& paths) {
  if (!paths.libraries.empty())
    unit << "Environment=" << command_word("LD_LIBRARY_PATH=" + paths.libraries.string()) << '\n';
  unit << "# Status 2: the file is wrong, which a restart does not mend.\n"
       << "Restart=on-failure\nRestartPreventExitStatus=2\nRestartSec=5\n";
}

}  // namespace

std::string command_word(const std::string& text) {
  if (!text.empty() && std::all_of(text.begin(), text.end(), is_plain)) return text;
  return '"' + escaped(text, true) + '"';
}

std::string path_value(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '%' ? "%%" : std::string{c};
  return out;
}

std::string listed_path(const std::string& text) {
  if (std::all_of(text.begin(), text.end(), is_plain)) return text;
  return '"' + escaped(text, false) + '"';
}

std::string unit_name(const config::Cell& cell) { return "invar-" + cell.name + ".service"; }

std::string bridge_unit_name(const config::Cell& cell) { return "invar-" + cell.name + "-bridge.service"; }

std::string unit_text(const LoadedCell& loaded, const UnitPaths& paths, const UnitOptions& options) {
  const config::Cell& cell = *loaded.cell;
  check(cell, paths, options);
  const Needs needs = needs_of(cell, options.host);
  const double watchdog = options.watchdog > 0.0 ? options.watchdog : std::max(10.0, 8.0 * needs.slowest);

  std::ostringstream unit;
  begin(unit, "host " + options.host, "", cell, paths, options);
  unit << " run " << command_word(paths.cell.string()) << " --host " << command_word(options.host)
       << " --real-time\n";
  if (cell.security)
    unit << "# `systemctl reload`: processes whose certificate was renewed start anew, one after the other.\n"
         << "ExecReload=/bin/kill -USR2 $MAINPID\n";
  environment_and_restarts(unit, paths);
  unit << "# A PC may wait for its network address; the status line says what is not "
          "up.\nTimeoutStartSec=infinity\n"
       << "# SIGTERM goes to `invar run` alone, which lets every axis stop before a process ends.\n"
       << "KillMode=mixed\nTimeoutStopSec=60\n"
       << "WatchdogSec=" << static_cast<long>(std::ceil(1000.0 * watchdog)) << "ms\n"
       << "StandardOutput=journal\nStandardError=journal\nSyslogIdentifier=invar-" << cell.name << '\n';
  if (needs.priority > 0) unit << "LimitRTPRIO=" << needs.priority << '\n';
  if (needs.lock_memory) unit << "LimitMEMLOCK=infinity\n";
  unit << confinement << "ReadWritePaths=" << listed_path(paths.data.string());
  for (const std::string& folder : written_elsewhere(loaded, options.host)) {
    check_path("`out` or `state`", folder);
    unit << ' ' << listed_path("-" + folder);
  }
  unit << "\n\n[Install]\nWantedBy=multi-user.target\n";
  return unit.str();
}

std::optional<std::string> bridge_unit_text(const LoadedCell& loaded, const UnitPaths& paths,
                                            const UnitOptions& options) {
  const config::Cell& cell = *loaded.cell;
  check(cell, paths, options);
  if (const BridgeFile bridge = read_bridge(loaded); bridge.lines.empty() || bridge.host != options.host)
    return std::nullopt;
  std::ostringstream unit;
  begin(unit, "bridge to the plant", " " + unit_name(cell), cell, paths, options);
  unit << " bridge " << command_word(paths.cell.string()) << " --host " << command_word(options.host) << '\n';
  environment_and_restarts(unit, paths);
  unit << "WatchdogSec=10s\nStandardOutput=journal\nStandardError=journal\nSyslogIdentifier=invar-"
       << cell.name << "-bridge\n"
       << confinement << "\n[Install]\nWantedBy=multi-user.target\n";
  return unit.str();
}

}  // namespace invar::tools
