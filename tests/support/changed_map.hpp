// A register map of deployment/ with one text of it replaced: what a hand may get wrong.
#pragma once

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

#include "tests/support/temporary_folder.hpp"

namespace invar::test {

/// Each pair of texts is replaced once; the first must occur.
inline std::filesystem::path changed_map(const invar::testing::TemporaryFolder& folder,
                                         const std::string& name,
                                         std::initializer_list<std::pair<std::string, std::string>> changes) {
  std::ostringstream text;
  text << std::ifstream{INVAR_SOURCE_DIR "/deployment/maps/" + name}.rdbuf();
  std::string changed = text.str();
  for (const auto& [from, to] : changes) {
    const auto at = changed.find(from);
    if (at == std::string::npos) throw std::runtime_error{name + " holds no `" + from + "`"};
    changed.replace(at, from.size(), to);
  }
  return folder.write(name, changed);
}

}  // namespace invar::test
