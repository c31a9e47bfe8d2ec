// A column of time in another unit than its header says, told from the model's own time constants.
#pragma once

#include <filesystem>

#include "tools/diagnose/data.hpp"

namespace invar::diagnose {

/// Throws InputError where the rows of a controller's recording are plainly no ticks of it: 200 of its periods apart, or ten
/// to a period. `time` in order, in s.
void check_ticks(const physics::Model& model, const std::vector<double>& time,
                 const std::filesystem::path& file);

/// Throws InputError where the model misses each output by five times as much as it would were the time in another unit
/// (ms, min, h for s, and the reverse), and follows the recording then. Only of a model whose user says of each number how
/// sure he is of it, and no worse than half of it: a start value may be as far off as a unit. The user's own equations with
/// less sure numbers are retuned first, as read and as a time in ms or s.
void check_clock(const Case& data);

}  // namespace invar::diagnose
