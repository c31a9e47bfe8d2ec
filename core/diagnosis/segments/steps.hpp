// Steps of the integration of own equations, as fine as the readings ask for.
#pragma once

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Halves the steps, at most twice, until half their length changes no output of the model `at` by a tenth of its noise.
/// The error of a coarse step looks like physics. The noise is RMS by output, or the user's if that is less.
/// False: they are fine enough as they are.
bool step_finely(Case& data, const physics::Model& at, const std::vector<double>& noise);

}  // namespace invar::diagnosis
