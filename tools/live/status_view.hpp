// The state of a cell as tables and as JSON: what `status` and `top` show.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <ostream>
#include <set>
#include <string>
#include <vector>

#include "core/dds/cell_client.hpp"

namespace invar::tools {

struct CellStatus {
  std::string cell;
  std::vector<lifecycle::ProcessStatus> processes;
  std::vector<lifecycle::ComponentStatus> components;
  std::vector<std::string> missing;    // processes that should be there and say nothing
  std::set<std::string> silent;        // processes that were there and fell silent
  std::vector<event::Notice> notices;  // what the cell said last, oldest first
  bool secured = false;                // the cell and this program know each other by certificates

  /// Faults of now, one line each: missing, ended, silent, tripped, in error, or at fault though it goes on.
  [[nodiscard]] std::vector<std::string> faults() const;
  /// Somebody answers, and nothing is wrong.
  [[nodiscard]] bool healthy() const;
  /// Whether everybody may read and command the cell, and the mend if so.
  [[nodiscard]] std::string security() const;
};

void print(const CellStatus& status, std::ostream& out);
[[nodiscard]] nlohmann::ordered_json to_json(const CellStatus& status);
/// The one shape of a process and of a component (docs/reference-json.md).
[[nodiscard]] nlohmann::ordered_json json_of(const lifecycle::ProcessStatus& process, bool silent);
[[nodiscard]] nlohmann::ordered_json json_of(const lifecycle::ComponentStatus& component);
/// Not active, and not in error: so it is until it was activated, and after it was deactivated.
[[nodiscard]] bool is_inactive(lifecycle::ComponentState state);
/// "active"
[[nodiscard]] std::string state_text(lifecycle::ComponentState state);
/// "warning"
[[nodiscard]] std::string level_text(event::Severity level);
/// "active", "active, standby", "active, took over".
[[nodiscard]] std::string state_and_role(const lifecycle::ComponentStatus& component);

}  // namespace invar::tools
