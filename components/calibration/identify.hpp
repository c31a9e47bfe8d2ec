// From measured lines to a compensation model on disk.
#pragma once

#include <filesystem>

#include "core/recording/table.hpp"

namespace invar::calibration {

/// Identifies the geometric error of the machine from displacement lines (columns as lines.csv of calibration.md) and writes
/// compensation.yaml into `folder`; returns its path. Throws InputError.
std::filesystem::path identify_geometric(const std::filesystem::path& machine, const recording::Table& lines,
                                         const std::filesystem::path& folder);

}  // namespace invar::calibration
