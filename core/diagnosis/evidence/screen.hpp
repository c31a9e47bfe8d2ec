// Screening: what each start would gain to first order, alone and in pairs, the nominal parameters free beside it.
#pragma once

#include <string>

#include "core/diagnosis/candidates/candidates.hpp"

namespace invar::diagnosis {

struct Screened {
  Start start;
  Eigen::MatrixXd columns;   // change of measured - simulated by each direction, not whitened
  Eigen::VectorXd strength;  // by direction, at the optimum
  double gain = 0.0;         // of log likelihood
  double merit = 0.0;        // gain less the price of its numbers
  bool impossible = false;   // needs a sign that its bounds forbid
};

/// Why no machine has what a start would need: "the best fit needs a negative time constant, which is impossible".
std::string why_impossible(const Start& start);

/// Best first by merit. `keep` bounds how many carry their columns.
std::vector<Screened> screen(const Case& data, const Weighing& weighing, const Fit& base,
                             const std::vector<Start>& starts, std::size_t keep);

struct ScreenedPair {
  Screened first, second;  // with the strengths that they have together
  Eigen::VectorXd shift;   // of the base's own numbers, in the order of its freedoms
  double merit = 0.0;
};

/// The pairs of `starts` that would gain most together, to first order; of each term its two best starts. Best first.
std::vector<ScreenedPair> screen_pairs(const Case& data, const Weighing& weighing, const Fit& base,
                                       const std::vector<Start>& starts, std::size_t most);

/// The base model with the screened term(s) at a share of their first-order strength.
physics::Model with(const Fit& base, const std::vector<const Screened*>& added, double share = 1.0);

/// A fit that begins with the screened term at whatever share of its first-order strength comes nearest: where the
/// system bends, first order may overshoot by far.
Fit fit_with(const Case& data, const Weighing& weighing, const Fit& base, const Screened& added,
             Effort effort);

/// For a curve: model, freedoms and sensitivities from which a fit may begin without finding them again.
Fit with_columns(const Case& data, const Fit& base, const Screened& added);

}  // namespace invar::diagnosis
