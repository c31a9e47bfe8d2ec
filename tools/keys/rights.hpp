// Rights: which topics each process, person and program of a cell reads and writes, from the deployment alone.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

enum class Role { process, launcher, bridge, operator_, viewer, plant };

/// "process", "launcher", "bridge", "operator", "viewer", "plant"
[[nodiscard]] std::string text_of(Role role);

/// Permissions of one certificate.
struct Rights {
  std::string name;
  Role role = Role::process;
  std::set<std::string> writes, reads;  // topics; those of reading may have a `*`
};

/// Everybody who takes part, in the order of the file. A process with a recorder, and each person, has a second participant
/// (`dds::second_name`). Throws InputError where a topic cannot stand in a permission.
[[nodiscard]] std::vector<Rights> rights_of(LoadedCell& cell);

/// Whether a process asks others for something: its certificate may write requests.
[[nodiscard]] bool has_supervisor(const LoadedProcess& process);
[[nodiscard]] bool has_recorder(const LoadedProcess& process);

}  // namespace invar::tools
