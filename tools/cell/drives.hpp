// Drives of a cell: whether every motor command moves the axis whose feedback its stage reads.
#pragma once

#include "core/base/fault.hpp"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// After the ports are connected; faults go to the document. A device that reports an axis must be given the motor command it waits
/// for. The motor command of a stage must go to the axis whose feedback the stage reads.
void check_drives(const LoadedCell& loaded);

/// Checks that could not be made, and how to make them possible: gains of a stage whose mass is not known.
[[nodiscard]] std::vector<Fault> unchecked(const LoadedCell& loaded);

}  // namespace invar::tools
