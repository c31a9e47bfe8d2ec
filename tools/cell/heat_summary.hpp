// Summary of a calibration over position and temperature: figures and plots from its files.
#pragma once

#include <filesystem>
#include <ostream>

#include "tools/report/page.hpp"

namespace invar::tools {

/// From verify_fixed.csv and verify_varying.csv in `folder`; nothing where they are not.
void summarise_heat(const std::filesystem::path& folder, report::Page& page, std::ostream& out);

}  // namespace invar::tools
