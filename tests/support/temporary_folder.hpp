// A folder that goes with the test.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "core/base/temporary_folder.hpp"

namespace invar::testing {

struct TemporaryFolder : invar::TemporaryFolder {
  TemporaryFolder() : invar::TemporaryFolder{"invar-test"} {}
  /// Makes this file of it and returns its path.
  std::filesystem::path write(const std::string& name, const std::string& content) const {
    std::ofstream{path() / name, std::ios::binary} << content;
    return path() / name;
  }
};

}  // namespace invar::testing
