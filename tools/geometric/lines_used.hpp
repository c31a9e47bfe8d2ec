// Which readings of displacement lines an identification used, and the error with those that it left out.
#pragma once

#include "core/metrology/geometric/geometric_identification.hpp"
#include "tools/geometric/lines_file.hpp"
#include "tools/report/left_out.hpp"

namespace invar::tools {

/// Each reading against the model at its point, less what its line shares: levels between breaks of the beam, drift, lost
/// motion, as the readings that were used tell them. Readings a hundredth of the line off are counted, not weighed: they
/// were no readings of this line. `found` was identified from `input`.
report::LeftOut lines_used(const metrology::Identification& found, const LinesFile& input);

}  // namespace invar::tools
