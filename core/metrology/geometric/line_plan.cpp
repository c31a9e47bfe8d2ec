#include "core/metrology/geometric/line_plan.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/base/index.hpp"
#include "core/metrology/geometric/geometric_field.hpp"
#include "core/numerics/decompositions.hpp"

namespace invar::metrology {

namespace {

/// A point whose coordinates along the chain's axes are parts of their travels.
Eigen::Vector3d at(const Machine& machine, double a, double b, double c) {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  const std::array<double, 3> parts{a, b, c};
  for (int place = 0; place < machine.chain.axes; ++place) {
    const int axis = machine.chain.order[index(place)];
    const Range r = machine.travel[index(axis)];
    point[axis] = r.lower + parts[index(place)] * r.width();
  }
  return point;
}

/// "y along", "x at y", "xy diagonal": built from what moves and what stands off.
std::string name_of(const Machine& machine, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  std::string moving;
  std::string beside;
  for (int place = 0; place < machine.chain.axes; ++place) {
    const int axis = machine.chain.order[index(place)];
    const Range r = machine.travel[index(axis)];
    const double part = (to[axis] - from[axis]) / r.width();
    const std::string letter = axis_letter(axis);
    if (std::abs(part) > 1e-9) {
      moving +=
          (part < 0 ? "-" : (moving.empty() ? "" : "+")) + (std::abs(part) < 0.9 ? letter + "/2" : letter);
    } else if (from[axis] > r.lower + 1e-9) {
      beside += (beside.empty() ? " at " : " ") + letter + "=" +
                std::to_string(std::lround(from[axis] * 1e3)) + "mm";
    }
  }
  return moving + beside;
}

/// Whether two lines have the same ends, whichever way round, within a tenth of a millimetre.
bool same_place(const PlannedLine& a, const PlannedLine& b) {
  constexpr double near = 1e-4;
  return ((a.from - b.from).norm() < near && (a.to - b.to).norm() < near) ||
         ((a.from - b.to).norm() < near && (a.to - b.from).norm() < near);
}

PlannedLine line(const Machine& machine, const std::array<double, 3>& from, const std::array<double, 3>& to) {
  return line_between(machine, at(machine, from[0], from[1], from[2]), at(machine, to[0], to[1], to[2]));
}

}  // namespace

PlannedLine line_between(const Machine& machine, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return {name_of(machine, from, to), from, to, machine.tool};
}

std::vector<PlannedLine> recipe_lines(const Machine& machine, int level) {
  using P = std::array<double, 3>;
  using Ends = std::pair<P, P>;
  std::vector<Ends> ends;
  if (machine.chain.axes == 2) {
    ends = {{P{0, 0, 0}, P{1, 0, 0}},
            {P{0, 0, 0}, P{0, 1, 0}},
            {P{0, 1, 0}, P{1, 1, 0}},
            {P{0, 0, 0}, P{1, 1, 0}},
            {P{0, 0, 0}, P{.5, 1, 0}}};
    if (level >= 1) ends.emplace_back(P{1, 0, 0}, P{0, 1, 0});
    if (level >= 2) ends.emplace_back(P{0, 0, 0}, P{1, .5, 0});
  } else {
    ends = {{P{0, 0, 0}, P{1, 0, 0}},  {P{0, 0, 0}, P{0, 1, 0}},  {P{0, 0, 0}, P{0, 0, 1}},
            {P{0, 1, 0}, P{1, 1, 0}},  {P{0, 0, 1}, P{1, 0, 1}},  {P{0, 0, 1}, P{0, 1, 1}},
            {P{0, 0, 0}, P{1, 1, 0}},  {P{0, 0, 0}, P{1, .5, 0}}, {P{0, 0, 0}, P{1, 0, 1}},
            {P{0, 0, 0}, P{1, 0, .5}}, {P{0, 0, 0}, P{0, 1, 1}},  {P{0, 0, 0}, P{0, 1, .5}},
            {P{0, 1, 0}, P{1, 1, 1}},  {P{0, 0, 1}, P{1, 1, 1}}};
    if (level >= 1) {
      ends.emplace_back(P{1, 0, 0}, P{0, 1, 0});
      ends.emplace_back(P{1, 0, 0}, P{0, 0, 1});
      ends.emplace_back(P{0, 1, 0}, P{0, 0, 1});
    }
    if (level >= 2) {
      ends.emplace_back(P{0, 0, 0}, P{.5, 1, 0});
      ends.emplace_back(P{0, 0, 0}, P{.5, 0, 1});
      ends.emplace_back(P{0, 0, 0}, P{0, .5, 1});
    }
  }
  std::vector<PlannedLine> lines;
  for (const auto& [from, to] : ends) lines.push_back(line(machine, from, to));
  return lines;
}

std::vector<PlannedLine> candidate_lines(const Machine& machine) {
  std::vector<PlannedLine> lines = recipe_lines(machine, 2);
  const bool space = machine.chain.axes == 3;
  for (int place = 0; place < machine.chain.axes; ++place) {  // the edges
    for (int other = 0; other < (space ? 4 : 2); ++other) {
      std::array<double, 3> from{};
      from[index((place + 1) % machine.chain.axes)] = other % 2;
      if (space) from[index((place + 2) % 3)] = other / 2;
      std::array<double, 3> to = from;
      to[index(place)] = 1.0;
      lines.push_back(line(machine, from, to));
    }
  }
  using P = std::array<double, 3>;
  if (space) {
    lines.push_back(line(machine, P{0, 0, 0}, P{1, 1, 1}));
    lines.push_back(line(machine, P{1, 0, 0}, P{0, 1, 1}));
    lines.push_back(line(machine, P{0, 1, 0}, P{1, 0, 1}));
    lines.push_back(line(machine, P{0, 0, 1}, P{1, 1, 0}));
    lines.push_back(line(machine, P{0, .5, 0}, P{1, 0, 1}));
    lines.push_back(line(machine, P{.5, 0, 0}, P{0, 1, 1}));
    lines.push_back(line(machine, P{0, 0, .5}, P{1, 1, 0}));
  } else {
    lines.push_back(line(machine, P{1, 0, 0}, P{.5, 1, 0}));
    lines.push_back(line(machine, P{0, 1, 0}, P{1, .5, 0}));
    lines.push_back(line(machine, P{0, .5, 0}, P{1, 0, 0}));
  }
  std::vector<PlannedLine> unique;
  for (auto& one : lines)
    if (std::none_of(unique.begin(), unique.end(), [&](const PlannedLine& u) { return same_place(u, one); }))
      unique.push_back(std::move(one));
  return unique;
}

int points_of(const PlannedLine& planned, double interval) {
  return std::max(2, static_cast<int>(std::lround((planned.to - planned.from).norm() / interval)) + 1);
}

CondensedLine planned_equations(const PlannedLine& planned, const Effort& effort) {
  CondensedLine result;
  result.name = planned.name;
  result.beam.start = planned.from;
  result.beam.start_tool = planned.tool;
  result.beam.length = (planned.to - planned.from).norm();
  result.beam.direction = (planned.to - planned.from) / result.beam.length;
  const int points = points_of(planned, effort.interval);
  for (int j = 0; j < points; ++j) {
    result.points.push_back(planned.from + (planned.to - planned.from) * j / (points - 1));
    result.tools.push_back(planned.tool);
  }
  const double mass = effort.passes / (effort.noise * effort.noise);
  result.mass = Eigen::VectorXd::Constant(points, mass);
  result.sum = Eigen::VectorXd::Zero(points);
  result.cross = Eigen::MatrixXd::Constant(points, 1, mass);  // the zero point
  result.inner = Eigen::MatrixXd::Constant(1, 1, mass * points);
  result.right = Eigen::VectorXd::Zero(1);
  result.deviation = Eigen::VectorXd::Zero(points);
  result.deviation_sigma = Eigen::VectorXd::Constant(points, 1.0 / std::sqrt(mass));
  result.noise.noise = effort.noise;
  result.noise.readings = points * effort.passes;
  return result;
}

GeometricPrior assumed_prior(const Machine& machine, double motions, double angles) {
  GeometricPrior prior;
  double longest = 0.0;
  for (int k = 0; k < 3; ++k)
    if (machine.chain.has(k)) longest = std::max(longest, machine.travel[index(k)].width());
  prior.length.fill(longest / 3.0);
  prior.stretch = expected_stretch(machine.travel);
  // The share of a curve's variance that is left about its best line, over the longest axis.
  GeometricBasis basis;
  basis.splines.fill(numerics::CubicBSpline{Range{0.0, longest}, 20});
  GeometricPrior waves = prior;
  waves.angle_slope = 0.0;
  waves.stretch.fill(1.0);
  const Eigen::MatrixXd covariance = coefficient_covariance(basis, waves, rotation(0, 0));
  const auto n = covariance.rows();
  Eigen::MatrixXd line(n, 2);
  line << Eigen::VectorXd::Ones(n), Eigen::VectorXd::LinSpaced(n, -1.0, 1.0);
  const Eigen::MatrixXd apart =
      Eigen::MatrixXd::Identity(n, n) - line * (line.transpose() * line).inverse() * line.transpose();
  const double share = (apart * covariance * apart).trace() / static_cast<double>(n) /
                       (waves.amplitude[2] * waves.amplitude[2]);
  prior.amplitude = {motions / std::sqrt(share), motions / std::sqrt(share), angles / std::sqrt(share)};
  return prior;
}

Expectation expect(const Machine& machine, const std::vector<PlannedLine>& lines, const Effort& effort,
                   const GeometricPrior& prior, double misfit) {
  Expectation result;
  std::array<int, 3> intervals{1, 1, 1};
  for (int k = 0; k < 3; ++k) {
    if (!machine.chain.has(k)) continue;
    const double width = machine.travel[index(k)].width();
    intervals[index(k)] = std::clamp(static_cast<int>(std::lround(width / effort.interval)), 8, 20);
  }
  std::vector<Eigen::Vector3d> tools{machine.tool};
  for (const auto& one : lines) tools.push_back(one.tool);
  result.basis = make_basis(machine.chain, machine.travel, intervals, tools);
  const GeometricBasis& basis = result.basis;
  std::vector<CondensedLine> equations;
  std::vector<LineRows> rows;
  for (const auto& one : lines) {
    equations.push_back(planned_equations(one, effort));
    rows.push_back(rows_of(equations.back(), basis, {}));
    result.readings += equations.back().noise.readings;
  }
  Posterior posterior = solve(assemble(equations, rows, basis.size, misfit), basis, prior);
  result.knowledge = identifiability(basis, posterior, {}, machine.travel, machine.tool);
  result.covariance = std::move(posterior.covariance);
  return result;
}

double expected_left(const Expectation& expected, const PlannedLine& planned, double interval) {
  const LineRows rows = rows_of(planned_equations(planned, {interval, 1, 1e-6}), expected.basis, {});
  const Eigen::MatrixXd covariance = rows.rows * expected.covariance(rows.unknowns, rows.unknowns);
  return std::sqrt(covariance.cwiseProduct(rows.rows).sum() / static_cast<double>(rows.rows.rows()));
}

std::vector<PlannedLine> other_lines(const Machine& machine, const std::vector<PlannedLine>& lines) {
  std::vector<PlannedLine> others;
  for (PlannedLine& one : candidate_lines(machine))
    if (std::none_of(lines.begin(), lines.end(), [&](const PlannedLine& l) { return same_place(l, one); }))
      others.push_back(std::move(one));
  return others;
}

std::vector<NextLine> next_lines(const Machine& machine, const Identification& found, std::size_t count) {
  const auto& basis = found.basis;
  const Eigen::MatrixXd weight =
      shape_weight(basis, found.model.squareness, found.model.travel, found.model.tool);
  const Eigen::MatrixXd& covariance = found.posterior.widened;
  const double now = covariance.cwiseProduct(weight).sum();
  const Eigen::MatrixXd spread = covariance * weight * covariance;
  double readings = 0.0;
  double points = 0.0;
  for (const auto& one : found.lines) {
    readings += one.noise.readings;
    points += static_cast<double>(one.points.size());
  }
  constexpr int coarse = 12;  // points are enough to rank; each stands for its share of the readings
  const double per_point = readings / points * (points / static_cast<double>(found.lines.size())) / coarse;
  const double variance = found.noise * found.noise / per_point + found.misfit * found.misfit;
  std::vector<PlannedLine> measured;
  for (const CondensedLine& known : found.lines)
    measured.push_back(
        {known.name, known.beam.start, known.beam.start + known.beam.length * known.beam.direction});
  std::vector<NextLine> result;
  for (PlannedLine& candidate : other_lines(machine, measured)) {
    Effort effort;
    effort.interval = (candidate.to - candidate.from).norm() / (coarse - 1);
    const LineRows rows = rows_of(planned_equations(candidate, effort), basis, found.model.squareness);
    const Eigen::MatrixXd part = covariance(rows.unknowns, rows.unknowns);
    Eigen::MatrixXd inner = rows.rows * part * rows.rows.transpose();
    inner.diagonal().array() += variance;
    inner.array() += 1e-6;  // m^2: the zero point is free
    const Eigen::MatrixXd spread_part = spread(rows.unknowns, rows.unknowns);
    const Eigen::MatrixXd gain = rows.rows * spread_part * rows.rows.transpose();
    const double less = numerics::solve_positive(inner, gain).trace();
    result.push_back({std::move(candidate), std::sqrt(std::max(now - less, 0.0))});
  }
  std::sort(result.begin(), result.end(),
            [](const NextLine& a, const NextLine& b) { return a.volumetric_rms < b.volumetric_rms; });
  if (result.size() > count) result.resize(count);
  return result;
}

}  // namespace invar::metrology
