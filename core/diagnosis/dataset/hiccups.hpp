// Hiccups of a clock: stamps of an even recording that suddenly follow one another too fast.
#pragma once

#include <string>
#include <vector>

#include "core/physics/simulation.hpp"

namespace invar::diagnosis {

/// Leaves out the readings of a velocity sensor about such stamps, with a clause in `doubts`. The true rate there is a way over a
/// false time, and a few of those carry a whole fit. A late instrument reads it some rows later. The first readings of an
/// instrument that the model has as late are from before the recording, and are left out too. `record.time` in order.
void leave_out_hiccups(const physics::Model& model, physics::Record& record, const std::string& file,
                       std::vector<std::string>& doubts);

}  // namespace invar::diagnosis
