// Noise that wanders: what a smooth term explains, a slow walk of the noise may be too.
#pragma once

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// White noise of variance 1 and a slow wander beside it, a first-order memory.
struct Wander {
  double rows = 1.0;    // that the memory lasts
  double driven = 0.0;  // variance that enters it in a row; 0: there is none
};

/// The wander that makes these numbers likeliest. NaN: nothing was measured. The noise of an instrument wanders where it shows;
/// what is stored in a machine, as heat, also wanders unseen.
Wander wander_of(const std::vector<std::vector<double>>& series, bool is_instrument);
/// Log likelihood of the numbers as such noise, of whatever scale; comparable between series over the same rows.
double likelihood(const std::vector<std::vector<double>>& series, const Wander& wander);

/// The evidence of `one` over `other`, both under `weighing`. The noise is taken to wander as in the residual of `one`,
/// and for as much longer as `one` would hide.
double advantage_over_wander(const Case& data, const Weighing& weighing, const Fit& one, const Fit& other);

}  // namespace invar::diagnosis
