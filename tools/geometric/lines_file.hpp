// lines.csv: readings of displacement lines as a table, checked against the machine.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/base/range.hpp"
#include "core/metrology/geometric/displacement_line.hpp"
#include "core/metrology/geometric/machine.hpp"

namespace invar::tools {

struct LinesFile {
  std::vector<metrology::DisplacementLine> lines;
  int rows = 0;
  int without_value = 0;  // rows with an empty displacement
  int far_off = 0;        // rows so wrong that no statistics are needed (1 % of the line and more)
  std::vector<metrology::DisplacementLine> at_one_point;  // lines without length: what drifts there
  bool tells_direction = false;       // by a column; else it is that of the motion from reading to reading
  std::vector<std::string> repeated;  // lines left out that hold the very readings of another
  std::optional<Range> temperature;   // degC, of all readings; nothing without the column
};

/// Reads the columns of docs/reference/calibration-files.md#linescsv, or `deviation` (reading minus nominal) in the
/// place of `displacement`; lines of any kind may stand before the header. A file that begins as Renishaw's .rtl or
/// .pos is read as such. `interval` [m] above 0 keeps only points at its multiples from the line's start
/// (accuracy against data interval). Throws InputError with the first fault that makes the file unusable.
LinesFile read_lines(const std::filesystem::path& file, const metrology::Machine& machine,
                     double interval = 0.0);

}  // namespace invar::tools
