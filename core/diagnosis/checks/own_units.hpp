// Is what the user's equations count a column in the unit that they were taken to count it in?
#pragma once

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// Throws InputError where nothing is missing but a factor. An input taken as it stands in its column, not in SI, then brings
/// the model far nearer to the recording than `retuned`, as no numbers of the user's do.
void check_own_units(const Case& data, const Fit& retuned);

}  // namespace invar::diagnosis
