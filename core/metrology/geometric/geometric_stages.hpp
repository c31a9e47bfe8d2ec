// The thesis's order of identification, corrected (docs/references.md#errata): each step takes the results of the steps
// before as known.
#pragma once

#include <vector>

#include "core/metrology/geometric/geometric_equations.hpp"

namespace invar::metrology {

/// Positioning from the axis lines, then angles from the parallels beside them: difference of readings over the offset
/// (docs/references.md#e9). Straightness and squareness come from the diagonals of the coordinate planes, after every
/// known term is subtracted. A reading that cannot be split goes to both in equal measure (docs/references.md#e8,
/// docs/references.md#e12). Rolls come from the other diagonals (docs/references.md#e13). The prior only smooths and
/// shares; its strengths stay as given. An error motion that no step sees is zero.
Eigen::VectorXd mean_in_stages(const std::vector<CondensedLine>& lines, const std::vector<LineRows>& rows,
                               const GeometricBasis& basis, const GeometricPrior& prior, double misfit);

}  // namespace invar::metrology
