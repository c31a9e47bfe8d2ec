// What a term must be before it is claimed: of possible strength, clearly not zero, and seen to act.
#pragma once

#include <string>

#include "core/diagnosis/candidates/candidates.hpp"

namespace invar::diagnosis {

/// "overflow@x1+x2"
std::string label(const physics::Term& term);

/// Are there rows enough for this many numbers? What a few rows leave is the curve of their scale as much as physics.
bool is_affordable(const Case& data, const Fit& fit);

/// A claim must have a strength that is possible and clearly not zero.
bool stands(const Case& data, const Fit& fit, std::size_t term);

}  // namespace invar::diagnosis
