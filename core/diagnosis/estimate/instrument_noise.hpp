// Noise of the instrument of an output: the measure of every residual, whatever its colour.
#pragma once

#include "core/diagnosis/estimate/fit_comparison.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

/// The least step between two neighbouring readings that differ: what a converter counts in. It is far below the noise of
/// readings that have some; 0 where none differ.
double counting_step(const std::vector<double>& values);

/// [SI] 1 sigma of an output: the `noise` of the model's file; else the largest of three estimates. The first is from second
/// differences of neighbouring rows, of the readings or of the residual, whichever is less. The second is the scatter of the
/// reading while the machine rests, the third the step in which it counts. Errors that go on from row to row are no noise.
double instrument_noise(const Case& data, const std::vector<physics::Outputs>& simulated, std::size_t output);

/// The squared residual of a model in units of the instruments' noise: the mean of the rows, summed over the outputs. The noise
/// is that beside `best`, the nearer of the models that are compared.
double squares_in_noise(const Case& data, const Fit& fit, const Fit& best);
/// Does `one` leave less than the other, counted so? An output that errs by far more than its noise decides; what filters or a
/// count of independent rows make of a residual does not.
bool leaves_less(const Case& data, const Fit& one, const Fit& other);

}  // namespace invar::diagnosis
