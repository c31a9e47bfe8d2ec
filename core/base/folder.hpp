// A folder for results: whether one can stand there, and its creation.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace invar {

/// The flaw of a folder's name before it is created: a file stands at it or above it. Whether the disk takes it shows later.
[[nodiscard]] std::optional<std::string> flaw_of_folder(const std::filesystem::path& folder);

/// Creates it and the folders above it. Throws InputError with the reason.
void make_folder(const std::filesystem::path& folder);

}  // namespace invar
