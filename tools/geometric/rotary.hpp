// One rotary axis: the figures of ISO 230-2 from readings of its angle.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace invar::tools {

/// "a", "b" or "c" where the chain of a machine file is that one axis; empty otherwise, also where the file is no YAML.
std::string rotary_axis(const std::filesystem::path& machine);

struct RotaryTest {
  std::filesystem::path machine, lines, out;
  std::string axis;
  std::vector<std::string> tolerances;
  double device = 0.0;       // of 1
  double environment = 0.0;  // rad
};
/// Writes report.json, report.html and deviations.csv (position, forward, backward, their mean), prints the figures. Throws
/// InputError.
void test_rotary(const RotaryTest& test);

}  // namespace invar::tools
