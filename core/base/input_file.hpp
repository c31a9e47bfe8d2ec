// A file that is read from its beginning to its end.
#pragma once

#include <filesystem>
#include <string>

namespace invar {

/// Its descriptor, which the caller closes. A pipe is read if a program has it open for writing and begins within five
/// seconds. A pipe without a writer is refused within a quarter of a second; folders and devices, which have no end, at once.
/// `named`: the mend, as in "name a CSV file". Throws InputError.
int open_input(const std::filesystem::path& file, const std::string& named);

/// Says which file is read from now on, as `open_input` does, for a caller that opens the file by other means.
void note_input(const std::filesystem::path& file);
/// The file that was opened last, to name it where memory ends; empty before any. Any thread.
std::string last_input();

}  // namespace invar
