// From which side the points of a map were approached, where nobody recorded it.
#pragma once

#include <vector>

namespace invar::physics {

/// +1 where a point was reached from below, -1 from above, 0 as long as nothing moved. `positions` [m] in order of time.
/// A return by less than a thousandth of the travel is jitter of the reading and no reversal. A turning point that is
/// read twice was overrun and reached from the other side (ISO 230-2). One that is read more often is a standstill.
std::vector<double> directions_of_approach(const std::vector<double>& positions);

}  // namespace invar::physics
