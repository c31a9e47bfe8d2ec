// Malformed register maps and fault scripts: one file a fault, the file's name says which, and the one line that
// the loader must give stands beside it.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "core/base/fault.hpp"
#include "core/modbus/fault_script.hpp"
#include "core/modbus/map.hpp"

namespace invar::modbus {
namespace {

namespace fs = std::filesystem;

std::string contents(const fs::path& file) {
  std::ifstream stream{file};
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

/// The faults of the text, a line each, with the file's bare name.
std::string fault_lines(const fs::path& file, const RegisterMap& map) {
  const std::string text = contents(file);
  const std::string name = file.filename().string();
  try {
    if (name.starts_with("faults_"))
      (void)parse_faults(text, name, map);
    else
      (void)parse_map(text, name);
  } catch (const InputError& error) {
    std::string lines;
    for (const auto& fault : error.faults()) lines += fault.line() + "\n";
    return lines;
  }
  return "(no fault)\n";
}

TEST(InvalidModbusFiles, EachGivesItsOneExpectedLine) {
  const fs::path data = INVAR_TEST_DATA;
  const RegisterMap map = load_map(data / "modbus_map_of_fault_scripts.yaml");
  int files = 0;
  for (const auto& entry : fs::directory_iterator{data / "invalid/modbus"}) {
    if (entry.path().extension() != ".yaml") continue;
    ++files;
    auto expected = entry.path();
    EXPECT_EQ(fault_lines(entry.path(), map), contents(expected.replace_extension(".expected")));
  }
  EXPECT_GE(files, 80);
}

}  // namespace
}  // namespace invar::modbus
