#include "core/metrology/geometric/line_errors.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {

Eigen::Vector3d point(const LineReadings& readings, std::size_t row) {
  return {readings.x[row], readings.y[row], readings.z[row]};
}

/// `displaced(start, end, row)`: what is taken off a reading, `end` one behind the line's last row.
template <class Displaced>
LineErrors errors(const LineReadings& readings, Displaced displaced) {
  const std::size_t rows = readings.line.size();
  INVAR_EXPECTS(readings.x.size() == rows && readings.y.size() == rows && readings.z.size() == rows &&
                    readings.displacement.size() == rows,
                rows);
  LineErrors result;
  double squares = 0.0;
  for (std::size_t start = 0, end = 0; start < rows; start = end) {
    while (end < rows && readings.line[end] == readings.line[start]) ++end;
    LineErrors::Line line{readings.line[start], {}, {}};
    for (std::size_t i = start; i < end; ++i) {
      const double way = (point(readings, i) - point(readings, start)).norm();
      const double error = readings.displacement[i] - way - displaced(start, end, i);
      line.way.push_back(way);
      line.error.push_back(error);
      squares += error * error;
      result.maximum = std::max(result.maximum, std::abs(error));
    }
    result.lines.push_back(std::move(line));
  }
  if (rows > 0) result.rms = std::sqrt(squares / static_cast<double>(rows));
  return result;
}

}  // namespace

LineErrors line_errors(const LineReadings& readings) {
  return errors(readings, [](std::size_t, std::size_t, std::size_t) { return 0.0; });
}

LineErrors line_errors(const LineReadings& readings, const GeometricModel& model) {
  return errors(readings, [&](std::size_t start, std::size_t end, std::size_t row) {
    const Eigen::Vector3d from = point(readings, start);
    Eigen::Vector3d beam = Eigen::Vector3d::Zero();
    for (std::size_t i = start; i < end; ++i)
      if (const Eigen::Vector3d way = point(readings, i) - from; way.norm() > beam.norm()) beam = way;
    if (beam.norm() <= 0.0) return 0.0;
    const Eigen::Vector3d moved =
        model.error(point(readings, row), model.tool) - model.error(from, model.tool);
    return beam.normalized().dot(moved);
  });
}

}  // namespace invar::metrology
