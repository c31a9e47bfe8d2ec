// What an instrument adds to an output: the measure of every residual, whatever its colour.
#pragma once

#include "core/diagnosis/estimate/fit_comparison.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

/// [SI] 1 sigma of an output: what `noise` of the model says; else what second differences of neighbouring rows say (of the
/// readings or of what the model leaves of them, whichever is less), what the reading does while the machine rests, and the
/// step in which it counts, whichever is most. What goes on from row to row is none of it.
double instrument_noise(const Case& data, const std::vector<physics::Outputs>& simulated, std::size_t output);

/// What a model leaves in units of the instruments' noise, squared: the mean of the rows, summed over the outputs. The noise is
/// that beside `best`, the nearer of the models that are compared.
double squares_in_noise(const Case& data, const Fit& fit, const Fit& best);
/// Does `one` leave less than the other, counted so? An output that errs by far more than its noise decides; what filters or a
/// count of independent rows make of a residual does not.
bool leaves_less(const Case& data, const Fit& one, const Fit& other);

}  // namespace invar::diagnosis
