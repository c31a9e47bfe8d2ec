// Columns that show a fault of the recording rather than of the machine; a person should look at them before any physics.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

/// The recordings with each output moved that comes too early, and a clause in `doubts` for each. The retuned or the believed
/// model meets such an output far better some rows later, as no physics does, and better than the best model meets it now.
/// Nothing where none comes too early.
std::optional<Case> with_columns_in_step(const Case& as_read, const Case& judged, const Diagnosis& d);

/// Is an output said to come late that was moved since it came too early? Then it was not the column: what repeats is early by
/// one wave less what it is late by.
bool comes_late_again(const Case& moved, const Diagnosis& d);

}  // namespace invar::diagnosis
