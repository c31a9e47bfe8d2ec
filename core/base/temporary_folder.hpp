// A folder among the temporary files of the system that goes with its owner.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include "core/base/fault.hpp"

namespace invar {

class TemporaryFolder {
 public:
  /// Its name begins with `what`. Throws InputError where none can be made.
  explicit TemporaryFolder(const std::string& what) {
    std::string pattern = (std::filesystem::temp_directory_path() / (what + "-XXXXXX")).string();
    if (mkdtemp(pattern.data()) == nullptr)
      throw InputError{pattern, "a folder cannot be made there",
                       "see that TMPDIR names one that takes files"};
    path_ = pattern;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::filesystem::path& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

}  // namespace invar
