// Does what a model leaves over still follow what was recorded? Asked without any idea of the form.
#pragma once

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// By output, the share of the power of measured - simulated that goes with the recording. One of three shapes
/// explains it. The first is a surface of second order over all inputs, their motion and their past. The second is the named
/// terms' effects with numbers that change, the third any course over one input. Taken off is the share of the same series
/// shifted against the recording: chance and the colour of the noise are in both. 0 where it is no more than chance.
std::vector<double> followed_share(const Case& data, const Fit& fit);

/// By output, the share of its power in rows where it is more than `times` the size of what cannot be told from the row before.
/// Noise that wanders for long is so large, and the residual of a model that misses the greater part. It is 0 where nothing is
/// in proportion to the motion of the output itself. For plants that are simulated freely.
std::vector<double> far_share(const Case& data, const Fit& fit, double times);

/// Is what is left over far louder where the inputs say that more goes on? Noise does not know of them.
bool is_louder_in_motion(const Case& data, const Fit& fit);

/// Is it more than twice the noise that the user gave, or a quarter more where he wrote the equations down himself, and
/// related from row to row?
bool is_above_noise(const Case& data, const Fit& fit);

/// By output, the residual beyond the noise, in times the power of the noise. The noise is the user's, and the part that cannot
/// be told from the row before. It is 0 where the colour of noise may do as much, without a given noise, and in a loop that leads
/// the noise of one reading to the others.
std::vector<double> excess_over_noise(const Case& data, const Fit& fit);

/// Does `with` take most of what in the residual of `without` goes with the recording, beyond what a residual turned round would?
/// Noise that wanders does not know what was recorded. Never in a loop, which moves with its own noise.
bool goes_with_recording(const Case& data, const Fit& with, const Fit& without);

}  // namespace invar::diagnosis
