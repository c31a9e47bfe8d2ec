// Findings of a print job and their gain, for the summary of `invar run` and the report.
#pragma once

#include <filesystem>
#include <ostream>

#include "tools/report/page.hpp"

namespace invar::tools {

/// One sentence, for the head of the page. Nothing where `folder` holds no print.
void add_print_verdict(const std::filesystem::path& folder, report::Page& page);

/// Nothing where `folder` holds no print.
void summarise_print(const std::filesystem::path& folder, report::Page& page, std::ostream& out);

}  // namespace invar::tools
