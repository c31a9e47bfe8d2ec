#include "tools/geometric/controller_files.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <map>
#include <sstream>
#include <vector>

#include "core/base/angle.hpp"
#include "core/base/fault.hpp"
#include "core/base/index.hpp"

namespace invar::tools {

namespace {

constexpr int most_points = 256;  // LinuxCNC's table

char upper(int axis) { return "XYZ"[axis]; }

double rotary_place(const metrology::RotaryAxis& axis, int i) {
  return axis.travel.lower + axis.travel.width() * i / (most_points - 1);
}

Eigen::Vector3d home_of(const metrology::GeometricModel& model) {
  Eigen::Vector3d home = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k)
    if (model.chain.has(k))
      home[k] = model.travel[index(k)].contains(0.0) ? 0.0 : model.travel[index(k)].lower;
  return home;
}

}  // namespace

bool positioning_is_known(const metrology::GeometricModel& model, int axis,
                          const std::set<std::string>& unidentified) {
  const int component = metrology::translation(axis, axis);
  return model.chain.has(axis) && model.coefficients[index(component)].size() > 0 &&
         !unidentified.contains(std::string{metrology::iso_name(component)});
}

std::string isg_volumetric_csv(const metrology::GeometricModel& model, int count,
                               const std::set<std::string>& unidentified, int moving) {
  std::ostringstream out;
  out << std::setprecision(12);
  out << "// Volumetric error by Invar: actual minus commanded position, mm; axes as measured (ISO 841).\n"
      << "// Tool offset of the calibration: " << 1e3 * model.tool.x() << ' ' << 1e3 * model.tool.y() << ' '
      << 1e3 * model.tool.z() << " mm. Compensation list: file_format ISG_CSV, interpolation GRID.\n";
  out << (moving == 0 ? "// Mean of both directions.\n"
                      : (moving > 0 ? "// Axes moving forward.\n" : "// Axes moving backward.\n"));
  if (model.reference_temperature)
    out << "// Holds at a machine temperature of " << *model.reference_temperature << " degC.\n";
  if (!unidentified.empty()) {
    out << "// Not measured, hence not in here:";
    for (const auto& name : unidentified) out << ' ' << name;
    out << '\n';
  }
  for (int k = 0; k < 3; ++k)
    if (model.chain.has(k)) out << upper(k) << ' ';
  for (int k = 0; k < 3; ++k)
    if (positioning_is_known(model, k, unidentified)) out << 'E' << upper(k) << upper(k) << ' ';
  out << '\n';
  const auto nodes = [&](int axis) { return model.chain.has(axis) ? count : 1; };
  const auto at = [&](int axis, int i) {
    const Range r = model.travel[index(axis)];
    return model.chain.has(axis) ? r.lower + r.width() * i / (count - 1) : 0.0;
  };
  for (int l = 0; l < nodes(2); ++l)
    for (int j = 0; j < nodes(1); ++j)
      for (int i = 0; i < nodes(0); ++i) {
        const Eigen::Vector3d position{at(0, i), at(1, j), at(2, l)};
        const Eigen::Vector3d error = model.error(position, model.tool) +
                                      model.reversal_at(position, Eigen::Vector3d::Constant(moving));
        for (int k = 0; k < 3; ++k)
          if (model.chain.has(k)) out << 1e3 * position[k] << ' ';
        for (int k = 0; k < 3; ++k)
          if (positioning_is_known(model, k, unidentified)) out << 1e3 * error[k] << ' ';
        out << '\n';
      }
  return out.str();
}

std::string linuxcnc_compensation(const metrology::GeometricModel& model, int axis) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(6);
  const Range range = model.travel[index(axis)];
  const int points = most_points;
  for (int i = 0; i < points; ++i) {
    Eigen::Vector3d position = home_of(model);
    position[axis] = range.lower + range.width() * i / (points - 1);
    const double actual = position[axis] + model.error(position, model.tool)[axis];
    const double half = 0.5 * model.reversal[index(axis)].value(position[axis]);
    out << 1e3 * position[axis] << ' ' << 1e3 * (actual + half) << ' ' << 1e3 * (actual - half) << '\n';
  }
  // The controller stops reading at the first line that is no triplet, so words can only stand at the end.
  out << "# joint of " << upper(axis) << ": nominal, actual moving forward, actual moving backward [mm], "
      << "COMP_FILE_TYPE = 0\n";
  return out.str();
}

double linuxcnc_difference(const metrology::GeometricModel& model, int axis) {
  const Range range = model.travel[index(axis)];
  const double step = range.width() / (most_points - 1);
  const auto told = [&](double at, double way) {
    Eigen::Vector3d position = home_of(model);
    position[axis] = at;
    return model.error(position, model.tool)[axis] + 0.5 * way * model.reversal[index(axis)].value(at);
  };
  double largest = 0.0;
  for (int i = 0; i + 1 < most_points; ++i) {
    const double at = range.lower + i * step;
    for (const double way : {1.0, -1.0})
      largest = std::max(largest,
                         std::abs(told(at + 0.5 * step, way) - 0.5 * (told(at, way) + told(at + step, way))));
  }
  return largest;
}

std::string linuxcnc_compensation(const metrology::RotaryAxis& axis) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(9);
  for (int i = 0; i < most_points; ++i) {
    const double at = rotary_place(axis, i);
    out << at / degree << ' ' << (at + axis.value(at, 1.0)) / degree << ' '
        << (at + axis.value(at, -1.0)) / degree << '\n';
  }
  out << "# joint of " << static_cast<char>(axis.letter - 'a' + 'A')
      << ": nominal, actual moving forward, actual moving backward [deg], COMP_FILE_TYPE = 0\n";
  return out.str();
}

double linuxcnc_difference(const metrology::RotaryAxis& axis) {
  double largest = 0.0;
  for (int i = 0; i + 1 < most_points; ++i)
    for (const double way : {1.0, -1.0}) {
      const double low = rotary_place(axis, i), high = rotary_place(axis, i + 1);
      const double straight = 0.5 * (axis.value(low, way) + axis.value(high, way));
      largest = std::max(largest, std::abs(axis.value(0.5 * (low + high), way) - straight));
    }
  return largest;
}

std::string skew_numbers(const metrology::GeometricModel& model, const std::set<std::string>& unidentified) {
  std::ostringstream out;
  out << "# Squareness by Invar. angle: between the positive axes; ISO: rotation of the second axis; sigma "
         "of both.\n"
      << "# pair ISO angle_minus_90 [arcsec] ISO_value [urad] sigma [urad] mm_per_m\n";
  for (int a = 0; a < 3; ++a) {
    for (int b = a + 1; b < 3; ++b) {
      if (!model.chain.has(a) || !model.chain.has(b)) continue;
      const int pair = metrology::squareness_of(a, b);
      const double sigma = model.squareness_sigma[index(pair)];
      const std::string name{metrology::squareness_iso_name(pair)};
      if (!(sigma > 0.0) || !std::isfinite(sigma) || unidentified.contains(name)) {
        out << "# " << upper(a) << upper(b) << ' ' << name << " was not measured\n";
        continue;
      }
      const double cosine = model.squareness[index(pair)];
      out << upper(a) << upper(b) << ' ' << metrology::squareness_iso_name(pair) << std::fixed
          << std::setprecision(3) << ' ' << -std::asin(cosine) * 206264.806 << ' '
          << 1e6 * metrology::squareness_angle_from_cosine(pair, cosine) << ' '
          << 1e6 * model.squareness_sigma[index(pair)] << ' ' << std::setprecision(6) << 1e3 * cosine << '\n';
    }
  }
  return out.str();
}

IsgTable::IsgTable(const std::string& text) {
  std::istringstream stream{text};
  std::string row;
  std::vector<int> arguments;
  std::vector<int> parameters;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> records;
  while (std::getline(stream, row)) {
    if (const auto comment = row.find("//"); comment != std::string::npos) row.resize(comment);
    std::istringstream cells{row};
    std::string cell;
    if (arguments.empty() && parameters.empty()) {
      while (cells >> cell) {
        const std::string letters = "XYZ";
        if (cell.size() == 1 && letters.find(cell) != std::string::npos)
          arguments.push_back(static_cast<int>(letters.find(cell)));
        else if (cell.size() == 3 && cell[0] == 'E' && cell[1] == cell[2] &&
                 letters.find(cell[1]) != std::string::npos)
          parameters.push_back(static_cast<int>(letters.find(cell[1])));
        else
          throw InputError{"ISG table", "column `" + cell + "` is not known", "use X Y Z EXX EYY EZZ"};
      }
      continue;
    }
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    Eigen::Vector3d error = Eigen::Vector3d::Zero();
    double value = 0.0;
    std::size_t column = 0;
    for (; cells >> value; ++column) {
      if (column < arguments.size())
        position[arguments[column]] = 1e-3 * value;
      else if (column < arguments.size() + parameters.size())
        error[parameters[column - arguments.size()]] = 1e-3 * value;
    }
    if (column > 0) records.emplace_back(position, error);
  }
  for (const auto& [position, error] : records)
    for (int k = 0; k < 3; ++k) nodes_[index(k)].push_back(position[k]);
  std::size_t expected = 1;
  for (auto& axis : nodes_) {
    std::sort(axis.begin(), axis.end());
    axis.erase(std::unique(axis.begin(), axis.end()), axis.end());
    expected *= axis.size();
  }
  if (records.empty() || expected != records.size())
    throw InputError{"ISG table", "its records do not fill a grid", "give every node once"};
  values_.resize(expected);
  for (const auto& [position, error] : records) {
    std::size_t place = 0;
    for (int k = 2; k >= 0; --k) {
      const auto& axis = nodes_[index(k)];
      const auto found = std::lower_bound(axis.begin(), axis.end(), position[k]);
      place = place * axis.size() + static_cast<std::size_t>(found - axis.begin());
    }
    values_[place] = error;
  }
}

Eigen::Vector3d IsgTable::error(const Eigen::Vector3d& position) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::array<std::size_t, 3> low{};
  std::array<double, 3> part{};
  for (int k = 0; k < 3; ++k) {
    const auto& axis = nodes_[index(k)];
    if (axis.size() < 2) continue;
    const double q = std::clamp(position[k], axis.front(), axis.back());
    const auto next = std::upper_bound(axis.begin() + 1, axis.end() - 1, q);
    low[index(k)] = static_cast<std::size_t>(next - axis.begin()) - 1;
    part[index(k)] = (q - *(next - 1)) / (*next - *(next - 1));
  }
  for (unsigned corner = 0; corner < 8; ++corner) {
    double weight = 1.0;
    std::size_t place = 0;
    for (int k = 2; k >= 0; --k) {
      const bool high = ((corner >> static_cast<unsigned>(k)) & 1U) != 0U;
      weight *= high ? part[index(k)] : 1.0 - part[index(k)];
      const std::size_t node = std::min(low[index(k)] + (high ? 1U : 0U), nodes_[index(k)].size() - 1);
      place = place * nodes_[index(k)].size() + node;
    }
    if (weight > 0.0) sum += weight * values_[place];
  }
  return sum;
}

double linuxcnc_error(const std::string& text, double nominal, int direction) {
  std::istringstream stream{text};
  std::map<double, double> table;
  double at = 0.0;
  double forward = 0.0;
  double backward = 0.0;
  while (stream >> at >> forward >> backward)
    table[1e-3 * at] = 1e-3 * ((direction < 0 ? backward : forward) - at);
  if (table.size() < 2 || table.size() > most_points)
    throw InputError{"LinuxCNC table", "holds " + std::to_string(table.size()) + " points",
                     "2 to 256 are possible"};
  const auto next = table.upper_bound(nominal);
  if (next == table.begin()) return next->second;
  if (next == table.end()) return table.rbegin()->second;
  const auto before = std::prev(next);
  const double part = (nominal - before->first) / (next->first - before->first);
  return before->second + part * (next->second - before->second);
}

}  // namespace invar::tools
