// Columns of outputs that read one value: a dead sensor, or one that died on the way.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Leaves out all but the first number of an output that reads one value in every row, with a clause in `data.doubts`. Throws
/// InputError where no output reads more. For machines that move on from row to row.
void leave_out_dead(Case& data, const std::filesystem::path& file);

/// Leaves out an output from where on it reads one value to the end, though it never stood still before and another
/// signal goes on: its sensor died. With a clause in `doubts` for each. For machines that move on from row to row.
void leave_out_what_died(const physics::Model& model, physics::Record& record, const std::string& file,
                         std::vector<std::string>& doubts);

}  // namespace invar::diagnosis
