// Is what the user's equations count a column in the unit that they were taken to count it in?
#pragma once

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// Throws InputError where an input that was taken in SI, as it stands in its column, brings the model far nearer to the
/// recording than `retuned`, which no numbers of the user's do: then nothing is missing but a factor.
void check_own_units(const Case& data, const Fit& retuned);

}  // namespace invar::diagnosis
