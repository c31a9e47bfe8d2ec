// Steps of a search that were cut off: named as the report names them.
#pragma once

#include <string>
#include <vector>

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

/// Steps of the search, as the report names those that were not tried.
inline constexpr const char* own_numbers = "the model's own numbers refitted to their end";
inline constexpr const char* other_ways =
    "the recordings taken in other ways (columns in step, longer windows, quiet inputs)";
inline constexpr const char* in_step_columns = "columns that come early";
inline constexpr const char* longer_windows = "a search in longer windows";
inline constexpr const char* holds_longer = "whether the best model holds in longer windows";
inline constexpr const char* recorded_hold = "how the reference goes on between rows";
inline constexpr const char* beside_the_law = "the current beside the controller's law";
inline constexpr const char* quiet_inputs = "inputs without their noise";
inline constexpr const char* all_needed = "whether all that was found is needed";
inline constexpr const char* rivals_weighed = "other names in place of what was found";

void add_once(std::vector<std::string>& all, const std::string& one);

/// Adds what was not tried. A reader of the verdict alone must not take half a search for a whole one that found
/// nothing. A name that was never held against its rivals must not seem sure.
void say_not_tried(Diagnosis& d, const std::vector<std::string>& not_tried);

}  // namespace invar::diagnosis
