#include "core/metrology/geometric_waves.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace invar::metrology {

namespace {

constexpr double shortest = 2e-3;        // m, finer than any screw of a machine
constexpr double fewest_turns = 5.0;     // of a wave over the travel: fewer are a curve
constexpr double oversampling = 2.0;     // wave numbers a resolvable one
constexpr int most_numbers = 600;        // that are tried an axis
constexpr int most_waves = 4;            // an axis
constexpr double significance = 8.0;     // of log evidence, against some hundreds of numbers that are tried
constexpr double longer_is_likelier = 3.0;  // of log evidence that a shorter period must lead by
constexpr double apart = 1.5;            // resolvable numbers between two waves

std::size_t index(int i) { return static_cast<std::size_t>(i); }

/// The lines with what the model as it stands leaves of them.
struct Rest {
  std::vector<LineInformation> lines;
  std::vector<Eigen::VectorXd> weighted;  // by line: G (reading - A theta)
};

Rest rest_of(const std::vector<CondensedLine>& lines, const std::vector<LineRows>& rows,
             const std::vector<Eigen::VectorXd>& points, double misfit, const Eigen::VectorXd& mean) {
  Rest rest;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    rest.lines.push_back(information_of(lines[l], rows[l], misfit, &points[l]));
    const Eigen::VectorXd own = mean(rows[l].unknowns);
    rest.weighted.push_back(rest.lines.back().weighted - rest.lines.back().information * (rows[l].rows * own));
  }
  return rest;
}

/// Numbers of one axis, and what all lines tell of a wave of each: normal matrix 2 x 2 once the model is eliminated.
struct Scan {
  int axis = 0;
  Eigen::VectorXd numbers;  // rad/m
  std::vector<Eigen::Matrix2d> normal;
  std::vector<Eigen::MatrixXd> columns;  // by line: cosines and sines of all numbers, J x 2 numbers; empty: no share
};

double finest_step(const std::vector<CondensedLine>& lines, int axis, double width) {
  double finest = width;
  for (const auto& line : lines) {
    if (std::abs(line.beam.direction[axis]) < 1e-6) continue;
    std::vector<double> places;
    for (const auto& point : line.points) places.push_back(point[axis]);
    std::sort(places.begin(), places.end());
    std::vector<double> steps;
    for (std::size_t i = 1; i < places.size(); ++i)
      if (places[i] - places[i - 1] > 1e-7) steps.push_back(places[i] - places[i - 1]);
    if (steps.size() < 3) continue;
    std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
    finest = std::min(finest, steps[steps.size() / 2]);
  }
  return finest;
}

Scan scan_of(int axis, const std::vector<CondensedLine>& lines, const std::vector<LineRows>& rows,
             const Rest& rest, const GeometricBasis& basis, const Eigen::LLT<Eigen::MatrixXd>& system) {
  Scan scan;
  scan.axis = axis;
  const Range range = basis.splines[index(axis)].interval();
  // Diagonals read an axis at finer steps than lines along it: periods down to the finest step itself can be told.
  const double least = std::max(shortest, finest_step(lines, axis, range.width()));
  const double lowest = 2.0 * std::numbers::pi * fewest_turns / range.width();
  const double highest = 2.0 * std::numbers::pi / least;
  if (highest <= lowest) return scan;
  const double step = 2.0 * std::numbers::pi / (oversampling * range.width());
  const int count = std::min(most_numbers, static_cast<int>((highest - lowest) / step) + 1);
  scan.numbers.resize(count);
  for (int i = 0; i < count; ++i) scan.numbers[i] = lowest + i * step;
  const double middle = 0.5 * (range.lower + range.upper);
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(basis.size, 2 * count);
  scan.normal.assign(index(count), Eigen::Matrix2d::Zero());
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const CondensedLine& line = lines[l];
    scan.columns.emplace_back();
    const double along = line.beam.direction[axis];
    if (std::abs(along) < 1e-6) continue;
    const auto points = static_cast<Eigen::Index>(line.points.size());
    Eigen::ArrayXd from(points);
    for (Eigen::Index j = 0; j < points; ++j) from[j] = line.points[static_cast<std::size_t>(j)][axis] - middle;
    Eigen::MatrixXd& z = scan.columns.back();
    z.resize(points, 2 * count);
    for (int i = 0; i < count; ++i) {
      const double number = scan.numbers[i];
      const double start = number * (line.beam.start[axis] - middle);
      z.col(2 * i) = along * ((number * from).cos() - std::cos(start));
      z.col(2 * i + 1) = along * ((number * from).sin() - std::sin(start));
    }
    const Eigen::MatrixXd product = rest.lines[l].information * z;
    const Eigen::MatrixXd own = rows[l].rows.transpose() * product;
    for (std::size_t u = 0; u < rows[l].unknowns.size(); ++u)
      cross.row(rows[l].unknowns[u]) += own.row(static_cast<Eigen::Index>(u));
    for (int i = 0; i < count; ++i)
      scan.normal[index(i)] += z.middleCols<2>(2 * i).transpose() * product.middleCols<2>(2 * i);
  }
  system.matrixL().solveInPlace(cross);
  for (int i = 0; i < count; ++i)
    scan.normal[index(i)] -= cross.middleCols<2>(2 * i).transpose() * cross.middleCols<2>(2 * i);
  return scan;
}

/// Log evidence for a wave of the number, and its amplitudes.
struct Gain {
  double value = 0.0;
  Eigen::Vector2d amplitudes = Eigen::Vector2d::Zero();
};
Gain gain_of(const Scan& scan, int i, const Rest& rest, double expected) {
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (std::size_t l = 0; l < scan.columns.size(); ++l)
    if (scan.columns[l].size() > 0)
      right += scan.columns[l].middleCols<2>(2 * i).transpose() * rest.weighted[l];
  const double variance = expected * expected;
  const Eigen::Matrix2d inner = Eigen::Matrix2d::Identity() + variance * scan.normal[index(i)];
  Gain gain;
  gain.amplitudes = variance * inner.inverse() * right;
  gain.value = 0.5 * right.dot(gain.amplitudes) - 0.5 * std::log(std::max(inner.determinant(), 1e-300));
  return gain;
}

/// The most evident wave; among those that look nearly alike the longest.
std::optional<AxisWave> strongest(const std::vector<Scan>& scans, const Rest& rest, const GeometricBasis& basis,
                                  const GeometricPrior& prior) {
  std::optional<AxisWave> best;
  double most = significance;
  for (const Scan& scan : scans) {
    const double width = basis.splines[index(scan.axis)].interval().width();
    const auto taken = [&](double number) {
      return std::any_of(basis.waves.begin(), basis.waves.end(), [&](const AxisWave& wave) {
        return wave.axis == scan.axis &&
               std::abs(wave.number - number) < apart * 2.0 * std::numbers::pi / width;
      });
    };
    const auto own = std::count_if(basis.waves.begin(), basis.waves.end(),
                                   [&](const AxisWave& wave) { return wave.axis == scan.axis; });
    if (own >= most_waves) continue;
    for (int i = 0; i < scan.numbers.size(); ++i) {  // from long to short
      if (taken(scan.numbers[i])) continue;
      const Gain gain = gain_of(scan, i, rest, prior.wave_amplitude);
      // Neighbouring numbers are one wave: only a far shorter one must lead by more.
      const bool neighbour = best && best->axis == scan.axis &&
                             scan.numbers[i] - best->number < 2.0 * 2.0 * std::numbers::pi / width;
      const double lead = best && best->axis == scan.axis && !neighbour ? longer_is_likelier : 0.0;
      if (gain.value <= most + lead) continue;
      most = gain.value;
      best = AxisWave{scan.axis, scan.numbers[i], gain.amplitudes[0], gain.amplitudes[1]};
    }
  }
  return best;
}

/// All lines at once with the waves of `basis`, until their numbers stand still.
Eigen::VectorXd settle_waves(const std::vector<CondensedLine>& lines, std::vector<LineRows>& rows,
                             const std::vector<Eigen::VectorXd>& points, double misfit, GeometricBasis& basis,
                             const GeometricPrior& prior) {
  constexpr int most_rounds = 4;
  constexpr double still = 0.02;  // rad over the travel
  Eigen::VectorXd mean;
  for (int round = 0; round < most_rounds; ++round) {
    update_wave_rows(lines, basis, rows);
    mean = solve_mean(assemble(lines, rows, basis.size, misfit, points), basis, prior).mean;
    double moved = 0.0;
    std::vector<AxisWave> found;
    for (std::size_t i = 0; i < basis.waves.size(); ++i) {
      found.push_back(basis.wave(i, mean));
      const double width = basis.splines[index(found[i].axis)].interval().width();
      moved = std::max(moved, std::abs(found[i].number - basis.waves[i].number) * width);
    }
    basis.set_waves(std::move(found));
    if (moved < still) break;
  }
  update_wave_rows(lines, basis, rows);
  return mean;
}

}  // namespace

std::vector<AxisWave> find_waves(const std::vector<CondensedLine>& lines, const std::vector<LineRows>& rows,
                                 const std::vector<Eigen::VectorXd>& points, double misfit,
                                 const GeometricBasis& before, const GeometricPrior& prior) {
  GeometricBasis basis = before;
  std::vector<LineRows> own = rows;
  Eigen::VectorXd mean;
  const auto system = factored(assemble(lines, own, basis.size, misfit, points), basis, prior, mean);
  Rest rest = rest_of(lines, own, points, misfit, mean);
  std::vector<Scan> scans;
  for (int axis = 0; axis < 3; ++axis)
    if (basis.chain.has(axis)) scans.push_back(scan_of(axis, lines, own, rest, basis, system));
  std::erase_if(scans, [](const Scan& scan) { return scan.numbers.size() == 0; });
  while (const auto wave = strongest(scans, rest, basis, prior)) {
    std::vector<AxisWave> more = basis.waves;
    more.push_back(*wave);
    basis.set_waves(std::move(more));
    mean = settle_waves(lines, own, points, misfit, basis, prior);
    rest = rest_of(lines, own, points, misfit, mean);
  }
  return basis.waves;
}

}  // namespace invar::metrology
