// Summary of a job that identifies the sensors of an axis: the fused position beside the laser, before and after.
#pragma once

#include <filesystem>
#include <ostream>

#include "tools/report/page.hpp"

namespace invar::tools {

/// Adds lines and a plot; nothing where the folder holds no such runs.
void summarise_fusion(const std::filesystem::path& folder, report::Page& page, std::ostream& out);

}  // namespace invar::tools
