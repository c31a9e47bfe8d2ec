// Identification: from displacement lines to a geometric model, by all lines at once, or step by step as in the thesis.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "core/metrology/geometric/displacement_line.hpp"
#include "core/metrology/geometric/geometric_equations.hpp"
#include "core/metrology/geometric/geometric_model.hpp"
#include "core/metrology/geometric/machine.hpp"

namespace invar::metrology {

enum class IdentificationMethod {
  full,  // all lines at once, prior by evidence, posterior covariance (docs/explanation/geometric.md#estimator)
  displacement,  // the thesis's steps, corrected (docs/explanation/geometric.md#two-axes)
};

struct IdentificationOptions {
  IdentificationMethod method = IdentificationMethod::full;
  int least_intervals = 8;   // spline pieces an axis at least
  int most_intervals = 24;   // and at most
  bool search_prior = true;  // by evidence; false keeps `prior`, `strengths` and `misfit`
  StrengthMatrix strengths = StrengthMatrix::Zero();  // how well the prior's log strengths are known
  GeometricPrior prior;         // expected beforehand; a search begins with the `stretch` of the travels
  double misfit = 5e-8;         // m
  std::vector<AxisWave> waves;  // to begin with; a search of the prior looks for more
  std::function<void(double part, const std::string& what)> progress;  // may be empty
};

/// Result of an identification, with all that reports and planning need. The unknowns are those of `basis`.
struct Identification {
  GeometricModel model;
  GeometricBasis basis;
  GeometricPrior prior;
  StrengthMatrix strengths = StrengthMatrix::Zero();  // covariance of the prior's log strengths
  double misfit = 0.0;
  NormalEquations equations;
  Posterior posterior;
  std::vector<CondensedLine> lines;
  std::vector<LineRows> rows;
  std::vector<Eigen::VectorXd> point_weights;  // 1 where a point fits
  double noise = 0.0;                          // m, sd of one reading, over all lines
};

/// Readings in, model out: the one entry point for the command and for the live cell. Precondition: at least one line
/// has length (`beam_of`). Set-up only; under a second for 22 lines. No I/O.
Identification identify(const Machine& machine, const std::vector<DisplacementLine>& lines,
                        const IdentificationOptions& options = {});

/// Beam-wise error [m] that a model says a line reads at its points, zero at its start.
Eigen::VectorXd predicted_readings(const GeometricModel& model, const CondensedLine& line);

}  // namespace invar::metrology
