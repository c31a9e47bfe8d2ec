#include "tools/geometric/lines_file.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>

#include "core/base/fault.hpp"
#include "core/recording/table.hpp"
#include "tools/geometric/rtl_file.hpp"
#include "tools/geometric/sense_of_motion.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

namespace {

using metrology::DisplacementLine;
using metrology::Reading;

std::string column_name(const char* prefix, int axis) {
  return prefix + std::string(1, metrology::axis_letters[static_cast<std::size_t>(axis)]);
}

[[noreturn]] void refuse(const recording::Table& table, const std::string& column, std::size_t row,
                         const std::string& what, const std::string& mend) {
  throw InputError{table.file.string() + ": column `" + column + "`, row " + std::to_string(row + 1), what,
                   mend};
}

/// Positions of all rows; an axis that the machine lacks must stand still.
std::vector<Eigen::Vector3d> read_positions(const recording::Table& table,
                                            const metrology::Machine& machine) {
  std::vector<Eigen::Vector3d> positions(table.rows(), Eigen::Vector3d::Zero());
  for (int k = 0; k < 3; ++k) {
    const std::string name = column_name("", k);
    if (!machine.chain.has(k)) {
      if (const auto values = table.optionally_in(name, "m"))
        for (std::size_t i = 0; i < values->size(); ++i)
          if (std::abs((*values)[i] - values->front()) > 1e-9)
            refuse(table, name, i, "moves, but the machine has no such axis",
                   "add the axis to the machine's chain");
      continue;
    }
    const auto values = table.in(name, "m");
    const Range travel = machine.travel[static_cast<std::size_t>(k)];
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!std::isfinite(values[i])) refuse(table, name, i, "no number", "give every reading its position");
      if (values[i] < travel.lower - travel.width() || values[i] > travel.upper + travel.width())
        refuse(table, name, i, report::number(values[i], 6) + " m is far outside the travel of the machine",
               "check the unit, or the travel in the machine file");
      positions[i][k] = values[i];
    }
  }
  return positions;
}

/// No laser reads the same noise twice: such a line is a copy.
bool same_readings(const DisplacementLine& a, const DisplacementLine& b) {
  return std::ranges::equal(a.readings, b.readings, [](const Reading& one, const Reading& other) {
    return one.position == other.position && one.tool == other.tool && one.displacement == other.displacement;
  });
}

/// Displacements from deviations.
void add_nominal(DisplacementLine& line) {
  const auto beam = metrology::beam_of(line);
  for (Reading& reading : line.readings)
    reading.displacement +=
        beam.direction.dot(reading.position + reading.tool - beam.start - beam.start_tool);
}

void infer_directions(DisplacementLine& line) {
  const auto beam = metrology::beam_of(line);
  auto& readings = line.readings;
  std::vector<double> way;
  for (const Reading& reading : readings) way.push_back(beam.direction.dot(reading.position - beam.start));
  const std::vector<int> senses = senses_of_motion(way);
  for (std::size_t i = 0; i < readings.size(); ++i) readings[i].direction = senses[i];
}

/// Keeps the points that lie on multiples of `interval` from the start.
void thin(DisplacementLine& line, double interval) {
  const Eigen::Vector3d start = line.readings.front().position;
  std::erase_if(line.readings, [&](const Reading& reading) {
    const double steps = (reading.position - start).norm() / interval;
    return std::abs(steps - std::round(steps)) > 1e-3;
  });
}

/// "x" of "X".
std::string letter_of(std::string axis) {
  if (!axis.empty()) axis[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(axis[0])));
  return axis;
}

/// The runs of a Renishaw file as one displacement line along the axis that it names, or the only one of the machine.
LinesFile read_rtl(const std::filesystem::path& file, const metrology::Machine& machine) {
  const RtlFile rtl = load_rtl(file);
  if (rtl.rotary)
    throw InputError{file.string(), "is of a rotary axis", "name a machine whose chain is that axis, as [c]"};
  const auto axis = rtl.axis.empty() && machine.chain.axes == 1 ? std::optional<int>{machine.chain.order[0]}
                                                                : metrology::axis_named(letter_of(rtl.axis));
  if (!axis || !machine.chain.has(*axis))
    throw InputError{file.string(),
                     rtl.axis.empty() ? "does not say which axis was measured"
                                      : "is of axis " + rtl.axis + ", which the machine lacks",
                     "write the line `Axis: X` below USER-TEXT::, or name the machine of that axis"};
  LinesFile result;
  result.rows = static_cast<int>(rtl.readings.size());
  result.tells_direction = true;
  metrology::DisplacementLine line{rtl.axis.empty() ? std::string(1, "XYZ"[*axis]) : rtl.axis, {}};
  const Range travel = machine.travel[static_cast<std::size_t>(*axis)];
  const double start = rtl.targets[rtl.readings.front().target];
  const auto [lowest, highest] = std::minmax_element(rtl.targets.begin(), rtl.targets.end());
  if (*lowest < travel.lower - travel.width() || *highest > travel.upper + travel.width())
    throw InputError{file.string(), "its targets are far outside the travel of the machine",
                     "check the travel in the machine file"};
  // The farthest target gives the beam's sense; readings are counted along it.
  const double sign = std::abs(*highest - start) >= std::abs(*lowest - start) ? 1.0 : -1.0;
  for (const RtlReading& one : rtl.readings) {
    metrology::Reading reading;
    for (int k = 0; k < 3; ++k)
      if (const Range r = machine.travel[static_cast<std::size_t>(k)];
          machine.chain.has(k) && !r.contains(0.0))
        reading.position[k] = r.lower;
    reading.position[*axis] = rtl.targets[one.target];
    reading.tool = machine.tool;
    reading.displacement = sign * (rtl.targets[one.target] - start + one.deviation);
    reading.direction = sign > 0.0 ? one.direction : -one.direction;
    line.readings.push_back(reading);
  }
  result.lines.push_back(std::move(line));
  return result;
}

}  // namespace

LinesFile read_lines(const std::filesystem::path& file, const metrology::Machine& machine, double interval) {
  if (is_rtl(file)) return read_rtl(file, machine);
  const auto table = recording::Table::read_behind_preamble(file, {"line"}, {"displacement", "deviation"});
  LinesFile result;
  result.rows = static_cast<int>(table.rows());
  const recording::Column* names = table.find("line");
  if (names == nullptr) (void)table.in("line", "1");  // says what is missing
  const bool deviates = !table.has("displacement") && table.has("deviation");
  const std::string measured = deviates ? "deviation" : "displacement";
  const auto displacement = table.in(measured, "m");
  const auto positions = read_positions(table, machine);
  const auto direction = table.optionally_in("direction", "1");
  const auto temperature = table.optionally_in("temperature", "degC");
  for (std::size_t i = 0; temperature && i < temperature->size(); ++i) {
    const double value = (*temperature)[i];
    if (std::isfinite(value) && (value < -50.0 || value > 200.0))
      refuse(table, "temperature", i, report::number(value, 6) + " degC is no temperature of a machine",
             "check the value and its unit");
    if (!std::isfinite(value)) continue;
    result.temperature = result.temperature ? Range{std::min(result.temperature->lower, value),
                                                    std::max(result.temperature->upper, value)}
                                            : Range{value, value};
  }
  std::vector<Eigen::Vector3d> tools(table.rows(), machine.tool);
  for (int k = 0; k < 3; ++k) {
    const auto values = table.optionally_in(column_name("tool_", k), "m");
    for (std::size_t i = 0; values && i < values->size(); ++i)
      if (std::isfinite((*values)[i])) tools[i][k] = (*values)[i];
  }
  std::map<std::string, std::size_t> place;
  std::size_t first_value = table.rows();
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const std::string& name = names->texts[i];
    if (std::isinf(displacement[i]) || std::abs(displacement[i]) > 1000.0)
      refuse(table, measured, i, report::number(displacement[i], 6) + " m is out of range",
             "check the value and its unit");
    if (std::isnan(displacement[i])) {
      ++result.without_value;
      continue;
    }
    first_value = std::min(first_value, i);
    const auto [found, is_new] = place.try_emplace(name, result.lines.size());
    if (is_new) result.lines.push_back({name, {}});
    Reading reading;
    reading.position = positions[i];
    reading.tool = tools[i];
    reading.displacement = displacement[i];
    reading.direction = direction && (*direction)[i] < 0.0 ? -1 : 1;
    if (temperature) reading.temperature = (*temperature)[i];
    result.lines[found->second].readings.push_back(reading);
  }
  if (first_value == table.rows())
    throw InputError{file.string() + ": column `" + measured + "`", "holds no number at all",
                     "add the readings"};

  for (std::size_t i = 1; i < result.lines.size();) {
    const auto line = result.lines.begin() + static_cast<std::ptrdiff_t>(i);
    const bool copy = line->readings.size() > 3 &&
                      std::any_of(result.lines.begin(), line, [&](const DisplacementLine& earlier) {
                        return same_readings(earlier, *line);
                      });
    if (copy) {
      result.repeated.push_back(line->name);
      result.lines.erase(line);
    } else {
      ++i;
    }
  }
  result.tells_direction = direction.has_value();
  for (DisplacementLine& line : result.lines) {
    if (deviates) add_nominal(line);
    if (!direction) infer_directions(line);
  }
  for (DisplacementLine& line : result.lines) {
    if (interval > 0.0) thin(line, interval);
    const auto beam = metrology::beam_of(line);
    if (beam.length == 0.0) {
      result.at_one_point.push_back(line);
      continue;
    }
    // A reading one hundredth of the line off is no error of a machine: a count lost, or another unit.
    const double limit = std::max(1e-3, 0.01 * beam.length);
    const Reading first = line.readings.front();
    const auto before = line.readings.size();
    std::vector<double> off;
    for (const Reading& r : line.readings)
      off.push_back(r.displacement - beam.direction.dot(r.position + r.tool - first.position - first.tool));
    std::vector<double> sorted = off;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                     sorted.end());
    const double middle =
        std::abs(sorted[sorted.size() / 2]) < 0.1 * beam.length ? sorted[sorted.size() / 2] : 0.0;
    std::size_t i = 0;
    std::erase_if(line.readings, [&](const Reading&) { return std::abs(off[i++] - middle) > limit; });
    const auto dropped = before - line.readings.size();
    result.far_off += static_cast<int>(dropped);
    if (dropped * 5 > before)
      throw InputError{
          file.string() + ": column `" + measured + "`, line " + line.name,
          std::to_string(dropped) + " of " + std::to_string(before) +
              " readings differ from the commanded distance by more than a hundredth",
          "check the unit, the sign (the whole way along the beam, 0 at its start, not the error alone) "
          "and the beam's direction"};
  }
  std::erase_if(result.lines, [](const DisplacementLine& line) {
    return line.readings.size() < 2 || metrology::beam_of(line).length == 0.0;
  });
  if (result.lines.empty())
    throw InputError{file.string(), "no line has any length: all readings of a line stand at the same point",
                     "measure each line at several points"};
  return result;
}

}  // namespace invar::tools
