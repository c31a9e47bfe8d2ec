// A cell file, read and checked completely: every fault is found before anything starts.
#pragma once

#include "tools/cell/loaded_cell.hpp"

namespace invar::tools {

/// Throws InputError with all faults of the file: structure, component types, parameters, connections, QoS that cannot
/// match, two owners of one command.
LoadedCell load_cell(const std::filesystem::path& file);

}  // namespace invar::tools
