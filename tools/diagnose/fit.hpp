// Fitting a model's free numbers to the recordings: whitened residuals, priors, Levenberg-Marquardt.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "tools/diagnose/data.hpp"
#include "tools/diagnose/in_parallel.hpp"
#include "tools/diagnose/statistics.hpp"

namespace invar::diagnose {

/// One number that a fit may move.
struct Freedom {
  enum class Where { parameter, term, curve };
  Where where = Where::parameter;
  std::size_t term = 0;   // of terms and curves
  std::size_t index = 0;  // of the parameter, the term's parameter or the curve's value
  double scale = 1.0;     // a typical change; finite differences take a thousandth of it
  double center = 0.0;    // prior
  double sigma = 0.0;     // of the prior; not positive: none
  Range bounds;
};

double get(const physics::Model& model, const Freedom& freedom);
/// Sets it, and terms that share a nominal parameter with it.
void set(physics::Model& model, const Freedom& freedom, double value);

/// All that may move: parameters whose sigma is not 0, and the terms' amplitudes and shapes. `believed` holds the
/// priors of the nominal numbers.
std::vector<Freedom> freedoms(const physics::Model& model, const physics::Model& believed);

/// How residuals count: a filter for each output, and which rows belong to the fit.
struct Weighing {
  std::vector<Whitening> filters;                       // by output
  std::vector<std::vector<std::vector<bool>>> present;  // by recording, output, row
  Eigen::Index rows = 0;
  double left_of_inputs = 0.0;  // log likelihood, see Case
  double temper =
      1.0;  // what one nat of log likelihood counts: outputs of one loop tell the same thing twice
};

/// Rows that are measured; filters as fitted to the residuals of these simulations. Without `coloured` every row counts
/// alike: right for looking for physics in a residual that is not noise yet.
Weighing weigh(const Case& data, const std::vector<physics::Outputs>& simulated, bool coloured = true);

std::vector<physics::Outputs> simulate(const Case& data, const physics::Model& model);
/// The same of a model that nobody will ask for again; it pushes no other out of what is remembered.
std::vector<physics::Outputs> simulate_once(const Case& data, const physics::Model& model);
Eigen::VectorXd residual(const Case& data, const Weighing& weighing, const physics::Model& model);
Eigen::VectorXd residual(const Case& data, const Weighing& weighing,
                         const std::vector<physics::Outputs>& simulated);
/// measured - simulated through the filters of the weighing.
Eigen::VectorXd filtered(const Case& data, const Weighing& weighing, const Eigen::VectorXd& differences);
/// Each column through the filters of the weighing.
Eigen::MatrixXd whitened(const Case& data, const Weighing& weighing, const Eigen::MatrixXd& columns);
/// Of all outputs of all recordings, one behind the other.
Eigen::Index rows_of(const Case& data);
/// measured - simulated of all recordings and outputs below one another; NaN where nothing was measured.
Eigen::VectorXd differences(const Case& data, const std::vector<physics::Outputs>& simulated);

struct Fit {
  physics::Model model;
  std::vector<Freedom> free;
  Eigen::VectorXd sigma;  // of each freedom, from the curvature
  Eigen::MatrixXd covariance;
  double cost = 0.0;         // half the sum of squares, priors included, tempered
  double data_cost = 0.0;    // without the priors
  double evidence = 0.0;     // log, up to a constant common to all models of one weighing: BIC
  double unlikely = 0.0;     // log, in the evidence too: how rare its terms are, whatever the recording says
  Eigen::VectorXd residual;  // whitened
  Eigen::MatrixXd columns;   // sensitivities at or near the solution, not whitened
};

/// Of the cost of what the user believes, by each number that is free.
Eigen::VectorXd slope_of_priors(const Fit& fit);

/// What it costs (log) to call a sine in time a current and not a force: one recording shows both alike. Hum sits at the
/// mains' frequencies, shaking anywhere.
double price_of_current(double frequency);

/// From the numbers in `start`. `iterations` 0 only evaluates. The sensitivities of freedoms that `near` has too are
/// taken from there and then kept up to date by Broyden's rule; they are found anew where a step fails.
Fit fit(const Case& data, const Weighing& weighing, const physics::Model& start,
        const physics::Model& believed, int iterations, const Fit* near = nullptr);

}  // namespace invar::diagnose
