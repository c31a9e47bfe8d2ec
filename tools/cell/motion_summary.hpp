// Summary of a motion job: how far the axis was off its setpoint, before and after a model was given to its stage.
#pragma once

#include <filesystem>
#include <ostream>

#include "tools/report/page.hpp"

namespace invar::tools {

/// Adds lines and plots; nothing where the folder holds no motion.
void summarise_motion(const std::filesystem::path& folder, report::Page& page, std::ostream& out);

}  // namespace invar::tools
