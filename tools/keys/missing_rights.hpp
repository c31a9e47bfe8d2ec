// MissingRights: what a cell asks of permissions that were signed for an earlier one, or by an earlier Invar.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "core/base/fault.hpp"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// One fault for each of these names (of processes, launchers, people) whose signed permissions lack a topic that it needs.
/// Permissions that are not there, or that this user cannot read, are no matter here.
[[nodiscard]] std::vector<Fault> missing_rights(LoadedCell& cell, const std::set<std::string>& names);

}  // namespace invar::tools
