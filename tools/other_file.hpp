// The check that a command writes none of the files that it reads.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/fault.hpp"

namespace invar::tools {

/// Throws InputError where `written` is one of the files `read`, which it would take the place of.
inline void expect_other_file(const std::string& option, const std::filesystem::path& written,
                              const std::vector<std::filesystem::path>& read) {
  for (const auto& file : read) {
    std::error_code unknown;  // a file that is not there is said when it is read
    if (std::filesystem::equivalent(written, file, unknown))
      throw InputError{option, written.string() + " is a file that is read here, and would be lost",
                       "name another one"};
  }
}

}  // namespace invar::tools
