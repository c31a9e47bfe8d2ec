// Readings of one rotary axis: its machine file, a table of angles or a Renishaw file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/metrology/geometric/error_motion_identification.hpp"

namespace invar::tools {

/// "a", "b" or "c" where the chain of a machine file is that one axis; empty otherwise, also where the file is no YAML.
std::string rotary_axis(const std::filesystem::path& machine);

/// `travel: {c: [0, 6.2832]}` in rad, or `{c: {interval: [0, 360], unit: deg}}`; nothing where the file names none. Throws
/// InputError.
std::optional<Range> rotary_travel(const std::filesystem::path& machine, const std::string& axis);

struct RotaryReadings {
  metrology::ErrorMotionReadings readings;  // rad; `direction` of each reading
  std::size_t given = 0;                    // rows, those without a value too
};
/// Columns `c [deg]` and `deviation [arcsec]` (or `displacement [deg]`), optional `direction`. Throws InputError.
RotaryReadings read_rotary_readings(const std::filesystem::path& file, const std::string& axis);

}  // namespace invar::tools
