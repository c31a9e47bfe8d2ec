#include "components/calibration/identify.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/folder.hpp"
#include "core/compensation/geometric_file.hpp"
#include "core/compensation/thermal_file.hpp"
#include "core/machine/machine_file.hpp"
#include "core/metrology/geometric/geometric_identification.hpp"

namespace invar::calibration {

namespace {

std::vector<metrology::DisplacementLine> lines_of(const recording::Table& table) {
  std::vector<metrology::DisplacementLine> lines;
  const metrology::LineReadings rows = readings_of(table);
  const auto direction = table.in("direction", "");
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (lines.empty() || lines.back().name != rows.line[row]) lines.push_back({rows.line[row], {}});
    metrology::Reading reading;
    reading.position = {rows.x[row], rows.y[row], rows.z[row]};
    reading.displacement = rows.displacement[row];
    reading.direction = direction[row] < 0.0 ? -1 : 1;
    lines.back().readings.push_back(reading);
  }
  return lines;
}

}  // namespace

metrology::LineReadings readings_of(const recording::Table& lines) {
  return {lines.find("line")->texts, lines.in("x", "m"), lines.in("y", "m"), lines.in("z", "m"),
          lines.in("displacement", "m")};
}

IdentifiedGeometry identify_geometric(const std::filesystem::path& machine, const recording::Table& lines,
                                      const std::filesystem::path& folder) {
  IdentifiedGeometry result;
  result.model = metrology::identify(machine::load_machine(machine), lines_of(lines)).model;
  compensation::ModelText text{"geometric", {machine, folder / "lines.csv"}};
  compensation::write_geometric(text, result.model);
  result.file = folder / "compensation.yaml";
  text.write(result.file);
  return result;
}

metrology::ThermalReadings heat_readings(const recording::Table& table, const std::vector<std::string>& zones,
                                         const std::vector<bool>& wanted) {
  const auto vector = [&](const std::string& name, const char* unit) {
    const auto values = table.in(name, unit);
    Eigen::VectorXd result(std::count(wanted.begin(), wanted.end(), true));
    Eigen::Index next = 0;
    for (std::size_t i = 0; i < values.size(); ++i)
      if (wanted[i]) result(next++) = values[i];
    return result;
  };
  metrology::ThermalReadings readings{vector("x", "m"),
                                      vector("temperature", "degC"),
                                      vector("error", "m"),
                                      vector("heating_rate", "K/s"),
                                      vector("direction", "1"),
                                      vector("t", "s"),
                                      {}};
  for (const std::string& zone : zones)
    readings.zones.push_back({zone, vector("temperature_" + zone, "degC")});
  return readings;
}

IdentifiedHeat identify_heat(const metrology::ThermalReadings& readings, std::size_t axis,
                             std::uint32_t above, const std::filesystem::path& source,
                             const std::filesystem::path& folder) {
  make_folder(folder);
  IdentifiedHeat result{metrology::identify_thermal(readings), folder / "compensation.yaml"};
  compensation::ModelText text{"thermal", {source}};
  compensation::write_place(text, {static_cast<int>(axis), above});
  compensation::write_thermal(text, result.fit.model);
  text.write(result.file);
  return result;
}

double left_over(const metrology::ThermalReadings& readings, const metrology::ThermalError& model,
                 const std::vector<bool>& of) {
  const Eigen::VectorXd temperature = model.lag > 0.0 ? readings.lagged(model.lag) : readings.temperature;
  double squares = 0.0;
  double count = 0.0;
  for (Eigen::Index i = 0; i < readings.x.size(); ++i) {
    if (!of[static_cast<std::size_t>(i)]) continue;
    metrology::ThermalState at{readings.x(i), temperature(i), (*readings.heating_rate)(i), {}};
    for (std::size_t z = 0; z < model.zones.size(); ++z)
      for (const auto& zone : readings.zones)
        if (zone.name == model.zones[z].name) at.zones[z] = zone.temperature(i);
    squares += std::pow(readings.error(i) - model.value(at), 2);
    count += 1.0;
  }
  return count > 0.0 ? std::sqrt(squares / count) : 0.0;
}

}  // namespace invar::calibration
