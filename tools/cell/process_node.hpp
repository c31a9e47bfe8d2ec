// How a process of a cell meets the others by DDS, as its cell file has it.
#pragma once

#include "core/dds/node.hpp"
#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// Identity, addresses, clocks, real time and the size of the segment in shared memory. Before the components are taken out.
[[nodiscard]] dds::NodeOptions node_options(const LoadedCell& loaded, const LoadedProcess& of,
                                            bool simulated);

}  // namespace invar::tools
