// A jump changes the outputs at once: a scale that slips, a nozzle that clogs, lost counts, a joint between two rails.
#pragma once

#include <vector>

#include "core/diagnosis/candidates/start.hpp"
#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// Courses with one jump, where the residual of the fit asks for it: over time, and along the way of an instrument. Between
/// evenly spaced knots a jump is a ramp, and what that leaves looks like noise that wanders.
std::vector<Start> jump_starts(const Case& data, const Fit& fitted);

}  // namespace invar::diagnosis
