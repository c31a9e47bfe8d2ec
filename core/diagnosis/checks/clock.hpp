// A column of time in another unit than its header says, told from the model's own time constants.
#pragma once

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Throws InputError where the model misses each output by five times as much as it would were the time in another unit
/// (ms, min, h for s, and the reverse), and follows the recording then. Only of a model whose user says of each number how
/// sure he is of it, and no worse than half of it: a start value may be as far off as a unit. The user's own equations with
/// less sure numbers are retuned first, as read and as a time in ms or s.
void check_clock(const Case& data);

}  // namespace invar::diagnosis
