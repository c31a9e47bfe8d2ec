// Drives of a cell: whether every motor command moves the axis whose feedback its stage reads.
#pragma once

#include "core/base/fault.hpp"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// After the ports are connected. A device that reports an axis and waits for its motor command, but is given none; a stage whose
/// motor command goes nowhere, or to another axis than it reads: faults go to the document.
void check_drives(const LoadedCell& loaded);

/// What could not be checked, and what would have it checked: gains of a stage of which nobody says what it moves.
[[nodiscard]] std::vector<Fault> unchecked(const LoadedCell& loaded);

}  // namespace invar::tools
