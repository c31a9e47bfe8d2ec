// What a recording shows of itself rather than of the machine: columns that a person should look at before any physics.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tools/diagnose/diagnosis.hpp"

namespace invar::diagnose {

/// Leaves out all but the first number of an output that reads one value in every row, with a clause in `data.doubts`. Throws
/// InputError where no output reads more. Of machines that move on from row to row.
void leave_out_dead(Case& data, const std::filesystem::path& file);

/// Leaves out an output from where on it reads one value to the end, though it never stood still before and another
/// signal goes on: its sensor died. With a clause in `doubts` for each. Of machines that move on from row to row.
void leave_out_what_died(const physics::Model& model, physics::Record& record, const std::string& file,
                         std::vector<std::string>& doubts);

/// The recordings with each output moved that comes too early: that the retuned or the believed model meets far better
/// some rows later, as no physics does, and better than the best model meets it as it stands; with a clause in `doubts` for
/// each. Nothing where none comes too early.
std::optional<Case> with_columns_in_step(const Case& as_read, const Case& judged, const Diagnosis& d);

/// Is an output said to come late that was moved since it came too early? Then it was not the column: what repeats is early by
/// one wave less what it is late by.
bool comes_late_again(const Case& moved, const Diagnosis& d);

}  // namespace invar::diagnose
