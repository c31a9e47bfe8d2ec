// The equations that displacement lines give for the unknowns of a basis, and how well a prior explains them.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "core/metrology/geometric/displacement_line.hpp"
#include "core/metrology/geometric/geometric_basis.hpp"
#include "core/metrology/geometric/geometric_prior.hpp"

namespace invar::metrology {

/// One condensed line as rows on the unknowns that it touches.
struct LineRows {
  std::vector<int> unknowns;  // the columns that are not zero
  Eigen::MatrixXd rows;       // J x columns: d'(V(P_j) - V(S))
  Eigen::VectorXd remainder;  // J, what the squareness' linear form leaves out along the beam, m
  Eigen::VectorXd expansion;  // size, the line's own expansion (`LineNoise`) by those of the axes
};
LineRows rows_of(const CondensedLine& line, const GeometricBasis& basis, const Squareness& squareness);
/// The columns of the basis' waves, their number as it stands; all other columns as they are. `rows` may be of fewer waves.
void update_wave_rows(const std::vector<CondensedLine>& lines, const GeometricBasis& basis,
                      std::vector<LineRows>& rows);

/// Information of a line about its rows * unknowns, with the nuisances marginalised. `misfit` [m] and points that do not fit are
/// counted in. Misfit is the sd of errors that repeat at a point but follow no smooth model (encoder counts, fine pitch errors).
///   -2 log likelihood = constant - 2 weighted'e + e'G e + log_misfit,  G = mass - cross inner^-1 cross'.
struct LineInformation {
  Eigen::VectorXd mass;
  Eigen::MatrixXd cross;
  Eigen::LLT<Eigen::MatrixXd> inner;
  Eigen::VectorXd weighted;
  double constant = 0.0;
  double log_misfit = 0.0;  // log|I + misfit^2 G|
  /// G times some columns: far cheaper than G itself where a line has hundreds of points.
  [[nodiscard]] Eigen::MatrixXd times(const Eigen::MatrixXd& columns) const;
  /// rows' G rows.
  [[nodiscard]] Eigen::MatrixXd square(const Eigen::MatrixXd& rows) const;
};
/// `points` [0..1], by point, weakens points that do not fit; nullptr: all fit.
LineInformation information_of(const CondensedLine& line, const LineRows& rows, double misfit,
                               const Eigen::VectorXd* points);

/// Normal equations: -2 log likelihood = constant - 2 right'theta + theta' normal theta (+ the part of the misfit).
struct NormalEquations {
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
  double constant = 0.0;
  double log_misfit = 0.0;  // sum over the lines
};

/// Adds up all lines, each as `information_of` has it; `points` by line, may be empty.
NormalEquations assemble(const std::vector<CondensedLine>& lines, const std::vector<LineRows>& rows,
                         int unknowns, double misfit, const std::vector<Eigen::VectorXd>& points = {});

/// The posterior of the unknowns under a prior: theta ~ N(mean, covariance).
struct Posterior {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;  // H^-1
  Eigen::MatrixXd widened;     // the same, the strengths of the prior not known exactly either; may be empty
  Eigen::MatrixXd prior_covariance;  // Q^-1, block diagonal
  double log_evidence = 0.0;         // up to a constant of the data
};
Posterior solve(const NormalEquations& equations, const GeometricBasis& basis, const GeometricPrior& prior);

/// The same without the covariances, which cost most.
Posterior solve_mean(const NormalEquations& equations, const GeometricBasis& basis,
                     const GeometricPrior& prior);

/// H = A'C^-1 A + Q, factored, and the mean.
Eigen::LLT<Eigen::MatrixXd> factored(const NormalEquations& equations, const GeometricBasis& basis,
                                     const GeometricPrior& prior, Eigen::VectorXd& mean);

/// Prediction by the other lines alone, at the same prior, for a line that was among those solved: its rows * unknowns, m.
Eigen::VectorXd told_by_others(const CondensedLine& line, const LineRows& rows, double misfit,
                               const Eigen::VectorXd& points, const Posterior& posterior);

/// Log evidence of a prior, its gradient by the log strengths, and what the readings are expected to tell about these
/// (Fisher's information).
struct Evidence {
  double value = 0.0;
  Strengths slope = Strengths::Zero();
  StrengthMatrix information = StrengthMatrix::Zero();
};
Evidence evidence(const NormalEquations& equations, const GeometricBasis& basis, const GeometricPrior& prior);

/// The prior that explains the readings best, and how well its log strengths are known from these readings.
struct EvidentPrior {
  GeometricPrior prior;
  StrengthMatrix covariance = StrengthMatrix::Zero();  // of the log strengths
};
/// Fisher scoring from `start` under weak log-normal expectations about `expected`; about ten evaluations.
EvidentPrior most_evident(const NormalEquations& equations, const GeometricBasis& basis,
                          const GeometricPrior& expected, const GeometricPrior& start);

/// How the unknowns move with the log strengths: size x strength_count. `posterior` must be that of `prior`.
Eigen::MatrixXd strength_effects(const GeometricBasis& basis, const GeometricPrior& prior,
                                 const Posterior& posterior);

}  // namespace invar::metrology
