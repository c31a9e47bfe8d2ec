// A burst comes once and goes again: somebody leans on a stage, a cable is caught for a moment.
#pragma once

#include <vector>

#include "core/diagnosis/candidates/start.hpp"
#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// Forces over a part of the time, where the residual of the fit is far louder than before and after. Knots over the whole
/// time are too far apart for it.
std::vector<Start> burst_starts(const Case& data, const Fit& fitted);

}  // namespace invar::diagnosis
