// components.csv: readings of error motions that were measured one by one.
#pragma once

#include <filesystem>
#include <string>

#include "core/metrology/geometric/machine.hpp"
#include "tools/geometric/components_page.hpp"

namespace invar::tools {

/// Fills the readings of each component, the states of the machine and the squareness. Throws InputError with the file, the
/// column and the row, or the component, that is wrong.
void read_components_file(const std::filesystem::path& file, const metrology::Machine& machine,
                          ComponentsResult& result);

/// "degC", or "K/s" of a heating rate.
std::string unit_of_state(const std::string& name);

}  // namespace invar::tools
