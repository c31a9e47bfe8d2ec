// Fitting a model's free numbers to the recordings: whitened residuals, priors, Levenberg-Marquardt.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/diagnosis/estimate/freedom.hpp"
#include "core/diagnosis/estimate/weighing.hpp"

namespace invar::diagnosis {

/// How far a fit is followed.
struct Effort {
  int steps = 0;              // at most
  bool only_polishes = true;  // the derivatives are not looked at again

  /// The start as it stands.
  static constexpr Effort evaluate() { return {}; }
  /// A few steps of a fit that has been at its end before.
  static constexpr Effort polish(int steps) { return {steps, true}; }
  /// To its end, or so many steps.
  static constexpr Effort follow(int steps) { return {steps, false}; }
};

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
  Columns columns;           // sensitivities at or near the solution, not whitened
};

/// The price (log odds) of calling a sine in time a current and not a force: one recording shows both alike. Hum sits at the
/// mains' frequencies, shaking anywhere.
double price_of_current(double frequency);

/// From the numbers in `start`. The sensitivities of freedoms that `near` has too are taken from there and then kept up to date by Broyden's rule; they are found anew where a step fails.
Fit fit(const Case& data, const Weighing& weighing, const physics::Model& start,
        const physics::Model& believed, Effort effort, const Fit* near = nullptr);

}  // namespace invar::diagnosis
