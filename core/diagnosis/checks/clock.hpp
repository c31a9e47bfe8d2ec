// A column of time in another unit than its header says, told from the model's own time constants.
#pragma once

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Throws InputError where the model follows the recording only with the time in another unit. Tried are ms, min, h for s, and
/// the reverse; as read, the model misses each output by five times as much. Asked only of a model whose numbers all have a sigma of
/// at most half their value: a start value may be as far off as a unit. The user's own equations with
/// less sure numbers are retuned first, as read and as a time in ms or s.
void check_clock(const Case& data);

}  // namespace invar::diagnosis
