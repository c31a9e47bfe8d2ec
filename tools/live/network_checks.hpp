// Whether this PC's network lets a cell through: its address, the cell's ports, and what a firewall would stop.
#pragma once

#include <vector>

#include "core/config/cell.hpp"
#include "tools/live/host_checks.hpp"

namespace invar::tools {

/// Sends one datagram to the cell's discovery group on each address of this PC that the file names. The datagram is the header of
/// an empty RTPS message, which every implementation ignores.
[[nodiscard]] std::vector<Finding> check_network(const config::Cell& cell);

}  // namespace invar::tools
