// Initial state: where the first rows contradict the one that the model starts from.
#pragma once

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// The initial state, where the first rows contradict the one that the model starts from.
void give_start(Case& data, Recording& recording);
/// A loop that stands still and yet commands: its sum is not zero, the first command says how much it holds.
void give_start_of_sum(const Case& data, Recording& recording);

}  // namespace invar::diagnosis
