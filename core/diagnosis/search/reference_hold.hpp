// The course of a loop's reference between the rows, where not every cycle of the controller was recorded.
#pragma once

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Nobody says it: it is taken as held from row to row, or to go on smoothly where the retuned model then lies plainly nearer,
/// with a clause in `data.doubts`. Nothing where every cycle has its row, or where the model's file says it (`hold`).
void settle_hold(Case& data);

}  // namespace invar::diagnosis
