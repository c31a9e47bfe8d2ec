// Calibrations of a cell as a file: what its components keep beside the cell file, and how it gets back to its place.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/cell/loaded_cell.hpp"
#include "tools/deploy/archive.hpp"

namespace invar::tools {

/// Folders in which components of the cell keep models and other state: each `state`, and the models that commands sent. Those
/// that are relative lie below the folder in which the cell runs.
[[nodiscard]] std::vector<std::filesystem::path> calibration_folders(const LoadedCell& loaded);

/// All files of those folders as they are at one moment, also of a running cell; besides, for people, the cell file and the
/// files that it names. Throws InputError where a folder changes again and again, or a file cannot be read.
[[nodiscard]] std::string backup_of(const LoadedCell& loaded, const std::filesystem::path& data);

/// The folders take the content of the backup; after a fault all are as they were. A folder as it was before stays beside it as
/// NAME.before. A program that is killed between two folders leaves each of them whole.
/// Returns what was restored, one line a folder. Throws InputError for another cell's backup, a damaged one, or a cell of which a
/// process runs on this PC; nothing is changed then. `dry_run`: only these are looked for, but the last.
std::vector<std::string> restore(const LoadedCell& loaded, const std::filesystem::path& data,
                                 const std::string& bytes, const std::string& where, bool dry_run);

}  // namespace invar::tools
