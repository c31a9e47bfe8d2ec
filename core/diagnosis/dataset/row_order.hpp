// Order of rows: one a time stamp, and no more of them than the motion asks for.
#pragma once

#include <string>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Rows in order of time, one a time stamp. Column by column: an hour at 1 kHz is not held twice.
void put_in_order(physics::Record& record, DataCount& count);
/// A model without inputs loses nothing where rows closer than its motion are thinned. One file then has no more rows than
/// these, and where the motion allows it all files together.
void thin(physics::Record& record, const std::vector<std::string>& outputs, std::size_t files);

}  // namespace invar::diagnosis
