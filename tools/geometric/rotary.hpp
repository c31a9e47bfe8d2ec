// One rotary axis: its figures by ISO 230-2, its error over the angle as a model, the page.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace invar::tools {

struct RotaryOptions {
  std::filesystem::path machine, lines, out;
  std::string axis;  // "a", "b" or "c"
  std::vector<std::string> tolerances;
  double device = 0.0;       // of 1
  double environment = 0.0;  // rad
};
/// Writes compensation.yaml (of kind rotary), report.json, report.html and deviations.csv (position, forward, backward, mean),
/// prints the figures. Too few readings for figures or for a model are said, and the other is written. Throws InputError.
void calibrate_rotary(const RotaryOptions& options);

}  // namespace invar::tools
