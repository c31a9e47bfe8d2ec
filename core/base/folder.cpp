#include "core/base/folder.hpp"

#include "core/base/fault.hpp"

namespace invar {

namespace fs = std::filesystem;

std::optional<std::string> flaw_of_folder(const fs::path& folder) {
  if (folder.empty()) return "has no name";
  std::error_code none;
  for (fs::path part = fs::absolute(folder).lexically_normal(); part.has_relative_path();
       part = part.parent_path())
    if (const auto there = fs::status(part, none); fs::exists(there))
      return fs::is_directory(there) ? std::nullopt
                                     : std::optional{"is no folder: `" + part.string() + "` is a file"};
  return std::nullopt;
}

void make_folder(const fs::path& folder) {
  const std::string mend = "name another folder as `out`";
  if (const auto flaw = flaw_of_folder(folder)) throw InputError{folder.string(), *flaw, mend};
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw InputError{folder.string(), "cannot be created: " + failed.message(), mend};
}

}  // namespace invar
