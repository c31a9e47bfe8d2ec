#include "tools/geometric/rotary.hpp"

#include <cmath>
#include <fstream>
#include <iostream>
#include <map>

#include "core/base/new_file.hpp"
#include "core/config/yaml.hpp"
#include "core/recording/table.hpp"
#include "tools/commands/calibration_result.hpp"
#include "tools/geometric/positioning.hpp"
#include "tools/geometric/rtl_file.hpp"

namespace invar::tools {

namespace {

using metrology::TargetReadings;

constexpr double most_deviation = 0.02;  // rad: beyond a degree somebody mixed units

/// Sense of the motion that led to each reading, as for lines; by the column where it is there.
std::vector<int> directions_of(const recording::Table& table, const std::vector<double>& angle) {
  std::vector<int> result(angle.size(), 1);
  if (const auto told = table.optionally_in("direction", "1")) {
    for (std::size_t i = 0; i < angle.size(); ++i) result[i] = (*told)[i] < 0.0 ? -1 : 1;
    return result;
  }
  int after = 1;
  for (std::size_t i = angle.size(); i-- > 0;) {
    const double step = i > 0 ? angle[i] - angle[i - 1] : 0.0;
    if (std::abs(step) > 1e-7) after = step > 0.0 ? 1 : -1;
    result[i] = after;
  }
  return result;
}

std::vector<TargetReadings> read_targets(const RotaryTest& test) {
  if (is_rtl(test.lines)) {
    const RtlFile rtl = load_rtl(test.lines);
    if (!rtl.rotary)
      throw InputError{test.lines.string(), "is of a linear axis", "name a machine with that axis"};
    return targets_of(rtl);
  }
  const auto table =
      recording::Table::read_behind_preamble(test.lines, {"line"}, {"displacement", "deviation"});
  const auto angle = table.in(test.axis, "rad");
  const bool deviates = table.has("deviation");
  const std::string column = deviates ? "deviation" : "displacement";
  auto value = table.in(column, "rad");
  const auto directions = directions_of(table, angle);
  std::map<long, TargetReadings> targets;
  for (std::size_t i = 0; i < angle.size(); ++i) {
    if (std::isnan(value[i])) continue;
    if (!std::isfinite(angle[i]))
      throw InputError{test.lines.string() + ": column `" + test.axis + "`, row " + std::to_string(i + 1),
                       "no number", "give every reading its position"};
    if (!deviates) value[i] -= angle[i] - angle.front();
    if (!(std::abs(value[i]) < most_deviation))
      throw InputError{test.lines.string() + ": column `" + column + "`, row " + std::to_string(i + 1),
                       "is more than a degree off its target", "check the unit and the sign"};
    TargetReadings& one = targets[std::lround(angle[i] / 1e-7)];
    one.position = angle[i];
    (directions[i] > 0 ? one.forward : one.backward).push_back(value[i]);
  }
  std::vector<TargetReadings> result;
  for (auto& [key, one] : targets) result.push_back(std::move(one));
  return result;
}

}  // namespace

std::string rotary_axis(const std::filesystem::path& machine) {
  const auto yaml = config::Yaml::load(machine);
  const auto names = yaml.root()["chain"].as_texts();
  if (names.size() != 1) return "";
  return names[0] == "a" || names[0] == "b" || names[0] == "c" ? names[0] : "";
}

void test_rotary(const RotaryTest& test) {
  const auto yaml = config::Yaml::load(test.machine);
  (void)yaml.root().integer("invar_machine", 1, 1);
  (void)yaml.root()["chain"].as_texts();
  yaml.root()["travel"].accept_all();
  yaml.finish();
  const auto tolerances = read_tolerances(test.tolerances, true);
  std::string letter = test.axis;
  letter[0] = static_cast<char>(letter[0] - 'a' + 'A');
  auto found = test_of(letter, read_targets(test), {test.device, test.environment});
  if (!found)
    throw InputError{test.lines.string(),
                     "has no target that was read twice in one direction, or only one target",
                     "read each target in two cycles at least"};
  found->rotary = true;
  const std::vector<PositioningTest> tests{*found};
  report::Page page{"Rotary axis " + letter, test.lines.filename().string()};
  write_positioning(page, tests, tolerances);
  nlohmann::json json{{"kind", "rotary"}, {"unidentified", nlohmann::json::array()}};
  json["positioning"] = positioning_json(tests, tolerances);
  recording::Table table;
  std::vector<double> position, forward, backward, mean;
  for (const auto& one : found->figures.targets) {
    position.push_back(one.position);
    forward.push_back(one.mean_forward);
    backward.push_back(one.mean_backward);
    mean.push_back(one.mean);
  }
  table.add(test.axis, "rad", position);
  table.add("deviation_forward", "rad", forward);
  table.add("deviation_backward", "rad", backward);
  table.add("deviation", "rad", mean);
  std::error_code failed;
  std::filesystem::create_directories(test.out, failed);
  if (failed) throw InputError{test.out.string(), "cannot be made", "name a folder that may be written to"};
  table.write(test.out / "deviations.csv");
  std::ofstream stream = new_stream(test.out / "report.json");
  stream << json.dump(2) << '\n';
  stream.close();
  if (!stream)
    throw InputError{(test.out / "report.json").string(), "cannot be written", "check the space left"};
  page.write(test.out / "report.html");
  print_positioning(tests, tolerances, std::cout);
  std::cout << "wrote " << (test.out / "deviations.csv").string() << ", report.json, report.html\n";
}

}  // namespace invar::tools
