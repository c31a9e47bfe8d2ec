#include "core/metrology/geometric/geometric_waves.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/base/index.hpp"

namespace invar::metrology {

std::optional<double> usual_step(const CondensedLine& line, int axis) {
  std::vector<double> places;
  for (const auto& point : line.points) places.push_back(point[axis]);
  std::sort(places.begin(), places.end());
  std::vector<double> steps;
  for (std::size_t i = 1; i < places.size(); ++i)
    if (places[i] - places[i - 1] > 1e-7) steps.push_back(places[i] - places[i - 1]);
  if (steps.size() < 3) return std::nullopt;
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  return steps[steps.size() / 2];
}

namespace {

constexpr double shortest = 2e-3;            // m, finer than any screw of a machine
constexpr double fewest_turns = 5.0;         // of a wave over the travel: fewer are a curve
constexpr double oversampling = 2.0;         // wave numbers a resolvable one
constexpr int most_numbers = 600;            // that are tried an axis
constexpr int most_waves = 4;                // an axis
constexpr std::size_t enough_points = 1500;  // of lines along an axis: more would find no smaller wave
constexpr double significance = 8.0;  // of log evidence, against some hundreds of numbers that are tried
constexpr double longer_is_likelier = 3.0;  // of log evidence that a shorter period must lead by
constexpr double apart = 1.5;               // resolvable numbers between two waves

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
    rest.weighted.push_back(rest.lines.back().weighted - rest.lines.back().times(rows[l].rows * own));
  }
  return rest;
}

/// Numbers of one axis, and what all lines tell of a wave of each: normal matrix 2 x 2 once the model is eliminated.
struct Scan {
  int axis = 0;
  Eigen::VectorXd numbers;  // rad/m
  std::vector<Eigen::Matrix2d> normal;
  std::vector<Eigen::MatrixXd>
      columns;  // by line: cosines and sines of all numbers, J x 2 numbers; empty: no share
};

double finest_step(const std::vector<CondensedLine>& lines, int axis, double width) {
  double finest = width;
  for (const auto& line : lines) {
    if (std::abs(line.beam.direction[axis]) < 1e-6) continue;
    if (const auto step = usual_step(line, axis)) finest = std::min(finest, *step);
  }
  return finest;
}

/// Those along which the axis moves most, as many as make enough points: the others would only cost time.
std::vector<std::size_t> lines_to_scan(const std::vector<CondensedLine>& lines, int axis) {
  std::vector<std::size_t> order;
  for (std::size_t l = 0; l < lines.size(); ++l)
    if (std::abs(lines[l].beam.direction[axis]) > 1e-6) order.push_back(l);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::abs(lines[a].beam.direction[axis]) > std::abs(lines[b].beam.direction[axis]);
  });
  std::size_t points = 0;
  std::size_t count = 0;
  while (count < order.size() && points < enough_points) points += lines[order[count++]].points.size();
  order.resize(count);
  return order;
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
  const std::vector<std::size_t> chosen = lines_to_scan(lines, axis);
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(basis.size, 2 * count);
  scan.normal.assign(index(count), Eigen::Matrix2d::Zero());
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const CondensedLine& line = lines[l];
    scan.columns.emplace_back();
    if (std::find(chosen.begin(), chosen.end(), l) == chosen.end()) continue;
    const double along = line.beam.direction[axis];
    const auto points = static_cast<Eigen::Index>(line.points.size());
    Eigen::ArrayXd from(points);
    for (Eigen::Index j = 0; j < points; ++j)
      from[j] = line.points[static_cast<std::size_t>(j)][axis] - middle;
    Eigen::MatrixXd& z = scan.columns.back();
    z.resize(points, 2 * count);
    for (int i = 0; i < count; ++i) {
      const double number = scan.numbers[i];
      const double start = number * (line.beam.start[axis] - middle);
      z.col(2 * i) = along * ((number * from).cos() - std::cos(start));
      z.col(2 * i + 1) = along * ((number * from).sin() - std::sin(start));
    }
    const Eigen::MatrixXd product = rest.lines[l].times(z);
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
std::optional<AxisWave> strongest(const std::vector<Scan>& scans, const Rest& rest,
                                  const GeometricBasis& basis, const GeometricPrior& prior) {
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

/// Splines of the model: fine enough to carry the waves of their axis to a thousandth.
numerics::CubicBSpline spline_for_waves(const GeometricBasis& basis, int axis) {
  constexpr double knots_a_period = 8.0;
  numerics::CubicBSpline spline = basis.splines[index(axis)];
  for (const AxisWave& wave : basis.waves)
    while (wave.axis == axis && spline.spacing() > wave.period() / knots_a_period) spline = spline.halved();
  return spline;
}

/// Coefficients of an error motion on its axis' spline, waves included.
Eigen::VectorXd coefficients_with_waves(const GeometricBasis& basis, const Eigen::VectorXd& unknowns,
                                        const GeometricBasis::Block& block,
                                        const numerics::CubicBSpline& spline) {
  const int axis = axis_of(block.motion);
  Eigen::VectorXd result = basis.spline_coefficients(block.motion, unknowns);
  for (numerics::CubicBSpline coarse = basis.splines[index(axis)]; coarse.intervals() < spline.intervals();
       coarse = coarse.halved())
    result = coarse.halved(result);
  if (!is_positioning(block.motion)) return result;
  const Range range = spline.interval();
  for (std::size_t i = 0; i < basis.waves.size(); ++i) {
    if (basis.waves[i].axis != axis) continue;
    const AxisWave wave = basis.wave(i, unknowns);
    const auto at = [&](double q) {
      const double u = wave.number * (q - 0.5 * (range.lower + range.upper));
      return wave.cosine * std::cos(u) + wave.sine * std::sin(u);
    };
    // A spline of these coefficients meets the wave at each knot.
    const double stronger = 3.0 / (2.0 + std::cos(wave.number * spline.spacing()));
    for (int k = 0; k < spline.size(); ++k)
      result[k] += stronger * at(spline.place(k)) - at(basis.origin[index(axis)]);
  }
  return result;
}

/// All lines at once with the waves of `basis`, until their numbers stand still.
Posterior settle_waves(const std::vector<CondensedLine>& lines, std::vector<LineRows>& rows,
                       const std::vector<Eigen::VectorXd>& points, double misfit, GeometricBasis& basis,
                       const GeometricPrior& prior) {
  constexpr int most_rounds = 3;
  constexpr double still =
      0.1;  // rad over the travel: a tenth of the amplitude at its ends, to first order none
  Posterior posterior;
  for (int round = 0; round < most_rounds; ++round) {
    update_wave_rows(lines, basis, rows);
    posterior = solve_mean(assemble(lines, rows, basis.size, misfit, points), basis, prior);
    double moved = 0.0;
    std::vector<AxisWave> found;
    for (std::size_t i = 0; i < basis.waves.size(); ++i) {
      found.push_back(basis.wave(i, posterior.mean));
      const double width = basis.splines[index(found[i].axis)].interval().width();
      moved = std::max(moved, std::abs(found[i].number - basis.waves[i].number) * width);
    }
    basis.set_waves(std::move(found));
    if (moved < still) break;
  }
  update_wave_rows(lines, basis, rows);
  return posterior;
}

}  // namespace

void take_unknowns(GeometricModel& model, const GeometricBasis& basis, const Eigen::VectorXd& unknowns) {
  for (int k = 0; k < 3; ++k)
    model.splines[index(k)] = basis.chain.has(k) ? spline_for_waves(basis, k) : basis.splines[index(k)];
  for (const auto& block : basis.blocks)
    model.coefficients[index(block.motion)] =
        coefficients_with_waves(basis, unknowns, block, model.splines[index(axis_of(block.motion))]);
  model.squareness = basis.squareness(unknowns);
}

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
  double evidence = solve_mean(assemble(lines, own, basis.size, misfit, points), basis, prior).log_evidence;
  while (const auto wave = strongest(scans, rest, basis, prior)) {
    std::vector<AxisWave> waves = basis.waves;
    waves.push_back(*wave);
    GeometricBasis more = basis;
    more.set_waves(std::move(waves));
    const Posterior found = settle_waves(lines, own, points, misfit, more, prior);
    if (found.log_evidence < evidence + significance) break;  // the scan looked at some lines only
    evidence = found.log_evidence;
    basis = std::move(more);
    rest = rest_of(lines, own, points, misfit, found.mean);
  }
  return basis.waves;
}

}  // namespace invar::metrology
