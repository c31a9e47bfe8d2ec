// What a print job found and what it brought, for the summary of `invar run` and the report.
#pragma once

#include <filesystem>
#include <ostream>

#include "tools/report/page.hpp"

namespace invar::tools {

/// Nothing where `folder` holds no print.
void summarise_print(const std::filesystem::path& folder, report::Page& page, std::ostream& out);

}  // namespace invar::tools
