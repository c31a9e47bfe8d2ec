#include "tools/geometric/rotary_readings.hpp"

#include <cmath>

#include "core/base/unit.hpp"
#include "core/config/yaml.hpp"
#include "core/recording/table.hpp"
#include "tools/calibration/calibration_result.hpp"
#include "tools/geometric/rtl_file.hpp"
#include "tools/geometric/sense_of_motion.hpp"

namespace invar::tools {

namespace {

constexpr double most_deviation = 0.02;  // rad: beyond a degree somebody mixed units
constexpr double most_travel = 100.0;    // rad, 16 turns: beyond it somebody wrote degrees

std::vector<int> directions_of(const recording::Table& table, const std::vector<double>& angle) {
  const auto told = table.optionally_in("direction", "1");
  if (!told) return senses_of_motion(angle);
  std::vector<int> result;
  for (const double way : *told) result.push_back(way < 0.0 ? -1 : 1);
  return result;
}

RotaryReadings of_rtl(const std::filesystem::path& file) {
  const RtlFile rtl = load_rtl(file);
  if (!rtl.rotary) throw InputError{file.string(), "is of a linear axis", "name a machine with that axis"};
  std::vector<double> position, value;
  RotaryReadings result;
  for (const RtlReading& one : rtl.readings) {
    position.push_back(rtl.targets[one.target]);
    value.push_back(one.deviation);
    result.readings.direction.push_back(one.direction);
  }
  result.given = position.size();
  result.readings.position = vector_of(position);
  result.readings.value = vector_of(value);
  return result;
}

RotaryReadings of_table(const std::filesystem::path& file, const std::string& axis) {
  const auto table = recording::Table::read_behind_preamble(file, {"line"}, {"displacement", "deviation"});
  const auto angle = table.in(axis, "rad");
  const bool deviates = table.has("deviation");
  const std::string column = deviates ? "deviation" : "displacement";
  const auto measured = table.in(column, "rad");
  const auto directions = directions_of(table, angle);
  const auto where = [&](const std::string& name, std::size_t row) {
    return file.string() + ": column `" + name + "`, row " + std::to_string(row + 1);
  };
  std::vector<double> position, value;
  RotaryReadings result;
  result.given = angle.size();
  for (std::size_t i = 0; i < angle.size(); ++i) {
    if (std::isnan(measured[i])) continue;
    if (!std::isfinite(angle[i]))
      throw InputError{where(axis, i), "no number", "give every reading its position"};
    const double deviation = measured[i] - (deviates ? 0.0 : angle[i] - angle.front());
    if (!(std::abs(deviation) < most_deviation))
      throw InputError{where(column, i), "is more than a degree off its target",
                       "check the unit and the sign"};
    position.push_back(angle[i]);
    value.push_back(deviation);
    result.readings.direction.push_back(directions[i]);
  }
  if (position.empty())
    throw InputError{file.string() + ": column `" + column + "`", "holds no number at all",
                     "add the readings"};
  result.readings.position = vector_of(position);
  result.readings.value = vector_of(value);
  return result;
}

}  // namespace

std::string rotary_axis(const std::filesystem::path& machine) {
  const auto yaml = config::Yaml::load(machine);
  const auto names = yaml.root()["chain"].as_texts();
  if (names.size() != 1) return "";
  return names[0] == "a" || names[0] == "b" || names[0] == "c" ? names[0] : "";
}

std::optional<Range> rotary_travel(const std::filesystem::path& machine, const std::string& axis) {
  const auto yaml = config::Yaml::load(machine);
  (void)yaml.root().integer("invar_machine", 1, 1);
  (void)yaml.root()["chain"].as_texts();
  std::optional<Range> travel;
  if (const auto node = yaml.root()["travel"]; node.exists()) {
    const auto own = node.required(axis);
    if (own.is_map()) {
      const auto factor = *conversion(own.choice("unit", {"rad", "deg"}, "rad"), "rad");
      const Range written = own.required("interval").as_range("");
      travel = Range{factor(written.lower), factor(written.upper)};
    } else if (own.exists()) {
      travel = own.as_range("rad");
    }
    if (travel && travel->width() > most_travel)
      own.fault("is more than sixteen turns", "write degrees as {interval: [0, 360], unit: deg}");
  }
  yaml.finish();
  return travel;
}

RotaryReadings read_rotary_readings(const std::filesystem::path& file, const std::string& axis) {
  RotaryReadings result = is_rtl(file) ? of_rtl(file) : of_table(file, axis);
  result.readings.state.resize(0, result.readings.position.size());
  return result;
}

}  // namespace invar::tools
