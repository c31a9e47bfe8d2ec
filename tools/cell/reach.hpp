// Reach: whether the motions of a cell's jobs stay inside the travel of the axis that they move.
#pragma once

#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// After the ports are connected; faults go to the document. The axis is the stage that reads the commands of the job's component.
void check_reach(const LoadedCell& loaded);

}  // namespace invar::tools
