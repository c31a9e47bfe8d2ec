// A file that is read from its beginning to its end.
#pragma once

#include <filesystem>
#include <string>

namespace invar {

/// Its descriptor, which the caller closes. A pipe will do where somebody has it open to write into and begins within
/// five seconds; one without a writer is refused within a quarter of a second, and folders and devices, which have no
/// end, at once. `named`: what to name instead, as in "name a CSV file". Throws InputError.
int open_input(const std::filesystem::path& file, const std::string& named);

/// Says which file is read from now on, as `open_input` does, for whoever opens one by other means.
void note_input(const std::filesystem::path& file);
/// The file that was opened last, to name it where memory ends; empty before any. Any thread.
std::string last_input();

}  // namespace invar
