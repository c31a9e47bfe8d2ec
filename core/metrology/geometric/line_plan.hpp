// Which displacement lines to measure, and how accurate the result will be, before anybody unpacks the laser.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/metrology/geometric/geometric_identification.hpp"
#include "core/metrology/geometric/identifiability.hpp"

namespace invar::metrology {

struct PlannedLine {
  std::string name;
  Eigen::Vector3d from = Eigen::Vector3d::Zero();  // m
  Eigen::Vector3d to = Eigen::Vector3d::Zero();    // m
  Eigen::Vector3d tool = Eigen::Vector3d::Zero();  // m, offset of the reflector
};

/// The recipe of docs/explanation/geometric.md#line-recipe for a chain a, b, c (full rank for every order): 14 lines,
/// 17 with the anti-diagonals, 20 with the steep diagonals. For an XY table 5, 6 and 7 (the thesis's four with y = x/2,
/// + anti-diagonal, + y = 2x). `level` is 0, 1 or 2.
std::vector<PlannedLine> recipe_lines(const Machine& machine, int level);

/// Lines worth considering beside the recipe's: parallels along every edge, both body diagonals and their like.
std::vector<PlannedLine> candidate_lines(const Machine& machine);

/// The line from one point to another, named by what moves and what stands off, with the machine's tool.
PlannedLine line_between(const Machine& machine, const Eigen::Vector3d& from, const Eigen::Vector3d& to);

struct Effort {
  double interval = 0.02;  // m, along a line
  int passes = 6;          // readings of each point
  double noise = 1e-6;     // m, sd of one reading
};

/// Readings a line takes at an interval: end points included, at least two.
int points_of(const PlannedLine& line, double interval);

/// The line as equations without readings, for predicting accuracy: zero point and reversal free.
CondensedLine planned_equations(const PlannedLine& line, const Effort& effort);

/// The prior of a machine whose error motions have these RMS sizes about their best straight lines [m, rad]; for planning
/// without a pilot. A prior's amplitude is more: it also holds what the straight line takes away.
GeometricPrior assumed_prior(const Machine& machine, double motions, double angles);

/// Expected result of a set of lines under a prior (of a pilot, or assumed).
struct Expectation {
  Identifiability knowledge;
  int readings = 0;
  GeometricBasis basis;
  Eigen::MatrixXd covariance;  // of the basis' unknowns once the lines are measured
};
Expectation expect(const Machine& machine, const std::vector<PlannedLine>& lines, const Effort& effort,
                   const GeometricPrior& prior, double misfit = 5e-8);

/// RMS over a line, measured or not, of what its readings will show after compensation, without their noise [m].
double expected_left(const Expectation& expected, const PlannedLine& line, double interval);

/// The candidates that are not among `lines`, whichever way round.
std::vector<PlannedLine> other_lines(const Machine& machine, const std::vector<PlannedLine>& lines);

/// A line not yet measured and what it would leave of the expected volumetric error.
struct NextLine {
  PlannedLine line;
  double volumetric_rms = 0.0;  // m, expected with it
};
/// The candidates in order of what they would help, best first, measured as finely as the identification's own lines.
std::vector<NextLine> next_lines(const Machine& machine, const Identification& found, std::size_t count);

}  // namespace invar::metrology
