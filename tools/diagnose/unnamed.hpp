// Physics without a name: a curve over one variable, beside the named terms or instead of them.
#pragma once

#include "tools/diagnose/other_cause.hpp"

namespace invar::diagnose {

struct Curved {
  Fit fit;
  Weighing weighing;
  double gain = -1e300;  // over what it was added to, under its own filters
};

/// The curve that explains most beside `base`, of what was looked at.
Curved best_curve(const Case& data, const Fit& base, const Beside& looked);

/// Adds a curve as a finding where one is plainly needed. One that explains far more than the named terms takes their
/// place. `beside_best` is that of the best model.
void add_unnamed(const Case& data, Diagnosis& d, const Beside& beside_best);

}  // namespace invar::diagnose
