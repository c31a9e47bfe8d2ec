// Every cell file in tests/data/invalid/cell has one fault, the file's name; beside it stands the line that is expected.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "tools/cell/load_cell.hpp"

namespace invar::tools {
namespace {

const std::filesystem::path folder = std::filesystem::path{INVAR_TEST_DATA} / "invalid" / "cell";

std::vector<std::string> names() {
  std::vector<std::string> found;
  for (const auto& entry : std::filesystem::directory_iterator{folder})
    if (entry.path().extension() == ".expected") found.push_back(entry.path().stem().string());
  std::sort(found.begin(), found.end());
  return found;
}

std::string without_folder(std::string text) {
  const std::string prefix = folder.string() + "/";
  for (std::size_t at = 0; (at = text.find(prefix, at)) != std::string::npos;) text.erase(at, prefix.size());
  return text;
}

class InvalidCell : public ::testing::TestWithParam<std::string> {};

TEST_P(InvalidCell, GivesTheOneExpectedLine) {
  std::ifstream stream{folder / (GetParam() + ".expected")};
  const std::string expected{std::istreambuf_iterator<char>{stream}, {}};
  std::string lines;
  try {
    (void)load_cell(folder / (GetParam() + ".yaml"));
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults()) lines += without_folder(fault.line()) + "\n";
  }
  EXPECT_EQ(lines, expected);
}

INSTANTIATE_TEST_SUITE_P(Files, InvalidCell, ::testing::ValuesIn(names()),
                         [](const auto& file) { return file.param; });

TEST(Cell, TheOneThatTheyAreMadeFromIsSound) { EXPECT_NO_THROW((void)load_cell(folder / "sound.yaml")); }

TEST(Cell, TheOnesThatShipAreSound) {
  for (const char* file : {"xy-table.yaml", "print-cell.yaml", "mismatch.yaml"})
    EXPECT_NO_THROW((void)load_cell(std::filesystem::path{INVAR_SOURCE_DIR} / "deployment" / file));
}

}  // namespace
}  // namespace invar::tools
