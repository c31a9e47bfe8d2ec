// The black box as a recording: one message a cycle, readable by any MCAP tool.
#pragma once

#include <filesystem>

#include "core/executor/black_box.hpp"

namespace invar::tools {

/// Writes the cycles and signals that a trip left into `folder`; the file's name says process and cycle. Returns the file.
/// Throws InputError when it cannot be written.
std::filesystem::path write_black_box(const BlackBoxRecord& record, const std::filesystem::path& folder);

}  // namespace invar::tools
