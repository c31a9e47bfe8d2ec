// The verdict: what was found, tried on held-out stretches, weighed and put into one word.
#pragma once

#include "core/diagnosis/evidence/diagnosis.hpp"
#include "core/diagnosis/search/options.hpp"

namespace invar::diagnosis {

/// Fits without a third of the stretches in turn and compares there; takes findings back that do not help on them. The gain
/// of a model counts on the readings that it was fitted to, its residual on those `recorded`.
void hold_out(const Case& data, const Case& recorded, Diagnosis& d, Claims claims = Claims::checked);
/// The findings' terms as the best model has them, with their sigmas.
void give_sigmas(const Case& data, Diagnosis& d);
/// Probabilities, shares, sigmas and the verdict.
void conclude(const Case& data, Diagnosis& d);

}  // namespace invar::diagnosis
