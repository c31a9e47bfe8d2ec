#include "components/calibration/identify.hpp"

#include "core/compensation/geometric_file.hpp"
#include "core/machine/machine_file.hpp"
#include "core/metrology/geometric_identification.hpp"

namespace invar::calibration {

namespace {

std::vector<metrology::DisplacementLine> lines_of(const recording::Table& table) {
  std::vector<metrology::DisplacementLine> lines;
  const auto x = table.in("x", "m");
  const auto y = table.in("y", "m");
  const auto z = table.in("z", "m");
  const auto displacement = table.in("displacement", "m");
  const auto direction = table.in("direction", "");
  const auto& names = table.find("line")->texts;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (lines.empty() || lines.back().name != names[row]) lines.push_back({names[row], {}});
    metrology::Reading reading;
    reading.position = {x[row], y[row], z[row]};
    reading.displacement = displacement[row];
    reading.direction = direction[row] < 0.0 ? -1 : 1;
    lines.back().readings.push_back(reading);
  }
  return lines;
}

}  // namespace

std::filesystem::path identify_geometric(const std::filesystem::path& machine, const recording::Table& lines,
                                         const std::filesystem::path& folder) {
  const auto found = metrology::identify(machine::load_machine(machine), lines_of(lines));
  compensation::ModelText text{"geometric", {machine, folder / "lines.csv"}};
  compensation::write_geometric(text, found.model);
  const std::filesystem::path file = folder / "compensation.yaml";
  text.write(file);
  return file;
}

}  // namespace invar::calibration
