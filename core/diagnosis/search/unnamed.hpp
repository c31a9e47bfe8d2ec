// Physics without a name: a curve over one variable, beside the named terms or instead of them.
#pragma once

#include <set>
#include <string>

#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

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

/// Does a curve take far more than the names do of what the retuned model leaves, in units of the noise? A name that takes most
/// of it is right, and the rest is its form or the small effects beside it.
bool takes_far_more(const Case& data, const Diagnosis& d, const Fit& curve);

/// Beside a course alone: friction over the course's own variable, where the two leave plainly less. A course rounds off its
/// jump at rest, and may hide it from the search for names.
void name_friction_beside(const Case& data, Diagnosis& diagnosis,
                          const std::set<std::string, std::less<>>& without);

/// Leaves out a name that goes with time alone where it takes over part of the size of others: it follows anything slow. True
/// where one went.
bool leave_out_drift(const Case& data, Diagnosis& diagnosis);

}  // namespace invar::diagnosis
