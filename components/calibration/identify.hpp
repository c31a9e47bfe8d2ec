// From measured lines to a compensation model on disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/metrology/geometric/line_errors.hpp"
#include "core/metrology/thermal/thermal_identification.hpp"
#include "core/recording/table.hpp"

namespace invar::calibration {

/// The columns of lines.csv (docs/reference/calibration-files.md#linescsv).
[[nodiscard]] metrology::LineReadings readings_of(const recording::Table& lines);

struct IdentifiedGeometry {
  metrology::GeometricModel model;
  std::filesystem::path file;
};
/// Identifies the geometric error of the machine from displacement lines and writes compensation.yaml into `folder`.
/// Throws InputError.
IdentifiedGeometry identify_geometric(const std::filesystem::path& machine, const recording::Table& lines,
                                      const std::filesystem::path& folder);

struct IdentifiedHeat {
  metrology::ThermalFit fit;
  std::filesystem::path file;
};
/// The same for the error of `axis` over position and temperature, from the readings in the table `source` (columns as
/// thermal.csv), measured above the geometric model of checksum `above`.
IdentifiedHeat identify_heat(const metrology::ThermalReadings& readings, std::size_t axis,
                             std::uint32_t above, const std::filesystem::path& source,
                             const std::filesystem::path& folder);

/// The rows of thermal.csv for which `wanted` says so; column `temperature_NAME` for each of the zones.
metrology::ThermalReadings heat_readings(const recording::Table& table, const std::vector<std::string>& zones,
                                         const std::vector<bool>& wanted);

/// RMS of reading minus model [m] over the rows `of`, say those that were not fitted; `readings` are all, since a lag
/// remembers.
double left_over(const metrology::ThermalReadings& readings, const metrology::ThermalError& model,
                 const std::vector<bool>& of);

}  // namespace invar::calibration
