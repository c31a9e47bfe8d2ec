// What comes once and goes again: somebody leans on a stage, a cable is caught for a moment.
#pragma once

#include <vector>

#include "tools/diagnose/candidates.hpp"

namespace invar::diagnose {

/// Forces over a part of the time, where the residual of the fit is far louder than before and after. Knots over the whole
/// time are too far apart for it.
std::vector<Start> burst_starts(const Case& data, const Fit& fitted);

}  // namespace invar::diagnose
