// What a recording shows of itself rather than of the machine: columns that a person should look at before any physics.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/diagnose/diagnosis.hpp"

namespace invar::diagnose {

/// Leaves out all but the first number of an output that reads one value in every row, with a clause in `data.doubts`. Throws
/// InputError where no output reads more. Of machines that move on from row to row.
void leave_out_dead(Case& data, const std::filesystem::path& file);

/// A clause for each output that comes too early: that the retuned or the believed model meets far better some rows
/// later, as no physics does, and better than the best model meets it as it stands.
std::vector<std::string> misrecorded(const Case& data, const Diagnosis& d);

}  // namespace invar::diagnose
