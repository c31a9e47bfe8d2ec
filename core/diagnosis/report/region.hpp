// From where to where an effect shows.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/base/range.hpp"
#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

struct Region {
  std::string variable, unit;  // SI
  Range within;
  bool is_part = false;  // of what was recorded; false: it shows nearly everywhere
};

/// For each recorded variable with which the finding goes, the lowest and the highest value at which it acts. There the outputs
/// with it and without it differ by more than a third of the most (RMS over cells); a curve is more than a third of its
/// peak. Heat and equations add up what acts on them, and show it long after: there the effect of the term itself counts, if it
/// does not remember.
std::vector<Region> regions_of(const Case& data, const Diagnosis& d, std::size_t finding);

/// "force on the carriage, at position 94 mm to 110 mm": its place, and the regions that are a part of what was recorded.
std::string where_of(const Case& data, const Diagnosis& d, std::size_t finding);

}  // namespace invar::diagnosis
