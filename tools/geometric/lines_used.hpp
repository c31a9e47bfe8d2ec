// Which readings of displacement lines an identification used, and the error with those that it left out.
#pragma once

#include "tools/geometric/geometric_report.hpp"
#include "tools/report/left_out.hpp"

namespace invar::tools {

/// Each reading against the model at its point, less what its line shares: levels between breaks of the beam, drift, lost
/// motion, as the readings that were used tell them. Readings a hundredth of the line off are counted, not weighed: they
/// were no readings of this line. Needs `evaluate`.
report::LeftOut lines_used(const GeometricResult& result);

}  // namespace invar::tools
