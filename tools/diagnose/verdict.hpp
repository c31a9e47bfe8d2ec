// The verdict: what was found, tried on held-out stretches, weighed and put into one word.
#pragma once

#include "tools/diagnose/diagnosis.hpp"

namespace invar::diagnose {

/// Fits without a third of the stretches in turn and compares there; takes findings back that do not help on them.
void hold_out(const Case& data, Diagnosis& d, bool refuses = true);
/// Probabilities, shares, sigmas and the verdict.
void conclude(const Case& data, Diagnosis& d);

}  // namespace invar::diagnose
