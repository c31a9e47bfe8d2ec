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

  /// Nothing is missing, silent, tripped or in error.
  [[nodiscard]] bool healthy() const;
};

void print(const CellStatus& status, std::ostream& out);
[[nodiscard]] nlohmann::ordered_json to_json(const CellStatus& status);
/// "active"
[[nodiscard]] std::string state_text(lifecycle::ComponentState state);

}  // namespace invar::tools
