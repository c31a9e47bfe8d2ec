// Deployment: one release of a cell on all its PCs, or the one before on all of them.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/config/cell.hpp"
#include "tools/deploy/release.hpp"
#include "tools/deploy/remote.hpp"

namespace invar::tools {

struct DeployOptions {
  std::filesystem::path cell;
  std::filesystem::path prefix = "/opt/invar";  // the cell's folder is below it, on each PC
  std::string user = "invar";                   // of the service
  bool service = true;                          // systemd starts it; false: files only
  std::filesystem::path identity, ssh_config;
  int ssh_port = 0;
  std::string only;        // the one host that is meant; empty: all
  double patience = 60.0;  // s, for a service to start and for the cell to be well
};

/// State of a PC.
struct HostState {
  std::string machine, current = "-", previous = "-";  // "-": none
  std::vector<std::string> missing;                    // contents
};

/// The PCs on which processes run, as ssh reaches them. Throws InputError for one without an address.
[[nodiscard]] std::vector<RemoteHost> remote_hosts(const config::Cell& cell, const DeployOptions& options);

/// Told on the way, a line each.
using Tell = std::function<void(const std::string&)>;

/// One fault a line: of which host, and what. Empty: it is done, or nothing was to be done.
using HostFaults = std::vector<std::string>;

/// Sends what is missing to all PCs at the same time, has each check the whole of it, and only then makes it current on all. It
/// starts the services and looks at the cell from each PC. Where one fails, all get back what was current before.
/// Throws InputError for what is wrong in the file or in the options.
[[nodiscard]] HostFaults deploy(const DeployOptions& options, const Tell& tell);

/// Makes the release before current again, the same on all PCs.
[[nodiscard]] HostFaults roll_back(const DeployOptions& options, const Tell& tell);

/// The calibrations of all PCs, an archive in an archive: "pc-a.tar". Throws InputError for what is wrong in the file.
[[nodiscard]] HostFaults back_up(const DeployOptions& options, std::string& bytes);
/// Each PC gets its part back: the cell stops there, and starts again where it ran. All parts are judged first.
[[nodiscard]] HostFaults restore_backups(const DeployOptions& options, const std::string& bytes,
                                         const std::string& where, const Tell& tell);

/// Tells the release of each PC; for `--show`.
[[nodiscard]] HostFaults show(const DeployOptions& options, const Tell& tell);

}  // namespace invar::tools
