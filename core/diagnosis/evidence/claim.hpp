// Conditions of a claim: a term has a possible strength, is clearly not zero, and is seen to act.
#pragma once

#include <string>

#include "core/diagnosis/candidates/candidates.hpp"

namespace invar::diagnosis {

/// "overflow@x1+x2"
std::string label(const physics::Term& term);

/// Are there rows enough for this many numbers? The residual of a few rows is the curve of their scale as much as physics.
bool is_affordable(const Case& data, const Fit& fit);

/// A claim must have a strength that is possible and clearly not zero.
bool stands(const Case& data, const Fit& fit, std::size_t term);

}  // namespace invar::diagnosis
