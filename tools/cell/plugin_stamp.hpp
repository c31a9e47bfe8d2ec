// The stamp of a plug-in, read out of its file: what it was built against, before anything of it runs.
#pragma once

#include <filesystem>
#include <string>

#include "core/base/fault.hpp"

namespace invar::tools {

/// The stamp of this program.
[[nodiscard]] const std::string& own_stamp();
/// Without `what`: the file is a shared library that was built with the stamp of this program.
[[nodiscard]] Fault why_not_a_plugin(const std::filesystem::path& file);

}  // namespace invar::tools
