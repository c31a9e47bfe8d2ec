#include "tools/geometric/lines_used.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/numerics/decompositions.hpp"

namespace invar::tools {

namespace {

using metrology::CondensedLine;
using metrology::Reading;

constexpr double used_weight = 0.05;  // weight: below it a reading is an outlier (LineNoise::outliers)

struct Sums {
  std::vector<double> used, all;
  std::size_t outliers = 0, in_bad_points = 0;
};

/// Lost motion of a line at a place along its beam [m], reading forward minus backward.
double reversal_at(const CondensedLine& line, double along) {
  const auto& at = line.reversal.places;
  if (at.size() == 0) return line.noise.reversal;
  Eigen::Index k = 0;
  while (k + 1 < at.size() && at[k + 1] < along) ++k;
  if (k + 1 >= at.size() || along <= at[0]) return line.reversal.values[along <= at[0] ? 0 : at.size() - 1];
  const double part = (along - at[k]) / (at[k + 1] - at[k]);
  return (1.0 - part) * line.reversal.values[k] + part * line.reversal.values[k + 1];
}

/// Each reading less the model at its point, and less what the line shares: a level between two breaks of the beam, a drift, a
/// lost motion, fitted to the readings that were used.
Eigen::VectorXd apart_of(const metrology::Identification& found, std::size_t l,
                         const std::vector<Reading>& readings) {
  const CondensedLine& line = found.lines[l];
  const auto n = static_cast<Eigen::Index>(readings.size());
  const auto& rows = found.rows[l];
  const Eigen::VectorXd told = rows.remainder + rows.rows * found.posterior.mean(rows.unknowns);
  std::vector<int> breaks = line.noise.breaks;  // in the order in which they were found
  std::sort(breaks.begin(), breaks.end());
  const auto levels = static_cast<Eigen::Index>(breaks.size()) + 1;
  Eigen::MatrixXd shared = Eigen::MatrixXd::Zero(n, levels + 2);
  Eigen::VectorXd apart(n);
  Eigen::VectorXd weight(n);
  Eigen::Index level = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Reading& r = readings[static_cast<std::size_t>(i)];
    while (level + 1 < levels && i >= breaks[static_cast<std::size_t>(level)]) ++level;
    const Eigen::Vector3d way = r.position + r.tool - line.beam.start - line.beam.start_tool;
    const double along = line.beam.direction.dot(way);
    apart[i] = r.displacement - along - told[line.point_of[static_cast<std::size_t>(i)]] -
               0.5 * r.direction * reversal_at(line, along);
    shared(i, level) = 1.0;
    shared(i, levels) = static_cast<double>(i) / static_cast<double>(n) - 0.5;
    shared(i, levels + 1) = r.direction;
    const int point = line.point_of[static_cast<std::size_t>(i)];
    weight[i] = line.weights[i] >= used_weight && found.point_weights[l][point] > 0.5 ? 1.0 : 0.0;
  }
  const Eigen::VectorXd fit =
      numerics::shortest_least_squares((weight.asDiagonal() * shared), weight.cwiseProduct(apart));
  return apart - shared * fit;
}

void add_line(const metrology::Identification& found, std::size_t l, const std::vector<Reading>& readings,
              Sums& sums, std::vector<std::vector<std::string>>& shown) {
  const CondensedLine& line = found.lines[l];
  if (readings.size() != line.point_of.size()) return;  // condensed from others than these
  const Eigen::VectorXd apart = apart_of(found, l, readings);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (!std::isfinite(apart[k])) continue;
    const bool outlier = line.weights[k] < used_weight;
    const bool bad_point = found.point_weights[l][line.point_of[i]] <= 0.5;
    sums.all.push_back(apart[k]);
    sums.outliers += outlier ? 1U : 0U;
    sums.in_bad_points += bad_point && !outlier ? 1U : 0U;
    if (!outlier && !bad_point)
      sums.used.push_back(apart[k]);
    else
      shown.push_back({line.name, std::to_string(i + 1),
                       report::si(line.beam.direction.dot(readings[i].position - line.beam.start), "m", 4),
                       report::si(apart[k], "m")});
  }
}

}  // namespace

report::LeftOut lines_used(const metrology::Identification& found, const LinesFile& input) {
  report::LeftOut left_out;
  left_out.header = {"line", "reading of it", "along the beam", "from the model"};
  Sums sums;
  std::size_t condensed = 0;
  for (std::size_t l = 0; l < found.lines.size(); ++l) {
    const auto source = std::find_if(input.lines.begin(), input.lines.end(),
                                     [&](const auto& one) { return one.name == found.lines[l].name; });
    if (source == input.lines.end()) continue;
    condensed += source->readings.size();
    add_line(found, l, source->readings, sums, left_out.rows);
  }
  const auto count = [](int value) { return static_cast<std::size_t>(std::max(value, 0)); };
  left_out.given = count(input.rows);
  const std::size_t elsewhere =
      left_out.given -
      std::min(left_out.given, condensed + count(input.without_value) + count(input.far_off));
  left_out.used = condensed - sums.outliers - sums.in_bad_points;
  left_out.reasons = {{count(input.without_value), "without a value"},
                      {count(input.far_off), "a hundredth of the line off, not in the error over all"},
                      {sums.outliers, "outliers"},
                      {sums.in_bad_points, "at points that do not fit their neighbours"},
                      {elsewhere, "on lines that were left out, or between the intervals"}};
  left_out.rms_used = report::rms_of(sums.used);
  left_out.rms_all = report::rms_of(sums.all);
  if (found.misfit > found.noise)
    left_out.unexplained.push_back(
        "Error that repeats at its place, and that no function here explains, is " +
        report::si(found.misfit, "m") + " RMS, more than the noise of a reading (" +
        report::si(found.noise, "m") + "): the model leaves it.");
  return left_out;
}

}  // namespace invar::tools
