// Anew: where the states of a model are not what a run from the first row makes of them.
#pragma once

#include <vector>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Rows by recording from which on the states are unknown. One lies behind a gap in which the inputs may have done what they do
/// beside it, where the model would show that for long. Another is the first row of a further recording, unless its initial
/// states are known exactly and its first rows do not contradict. Rows behind a gap that the model soon forgets, and rows
/// without an input, are marked as nothing to compare with instead and counted in `data.windows.forgetting`. At most so many
/// rows.
std::vector<std::vector<std::size_t>> begun_anew(Case& data, std::size_t most);

/// The same of an axis whose current was recorded: its first row, for nobody says that it is at rest there, and the rows
/// behind gaps of the current.
std::vector<std::vector<std::size_t>> axis_begun_anew(Case& data);

/// Do the first rows of a recording contradict a state that an output shows, as the model begins?
bool starts_elsewhere(const Case& data, const Recording& recording);

}  // namespace invar::diagnosis
