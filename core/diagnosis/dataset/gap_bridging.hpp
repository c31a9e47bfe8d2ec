// Gaps of a closed loop: which rows behind one say nothing.
#pragma once

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// In a gap nobody knows what the reference did, and the loop goes on to feel it for a while. Where bridges by a cubic
/// and by a straight line make a difference in the simulation, nothing is compared.
void bridge_gaps(const physics::Model& model, Recording& recording, double step);

}  // namespace invar::diagnosis
