// The seed's order of identification, with its errata: each step takes what the steps before found as known.
#pragma once

#include <vector>

#include "core/metrology/geometric_equations.hpp"

namespace invar::metrology {

/// Positioning from the axis lines, angles from the parallels beside them (difference of readings over the offset,
/// erratum E9), straightness and squareness from the diagonals of the coordinate planes after every known term is
/// subtracted (E8, E11, E12: what one reading cannot split goes to both in equal measure), rolls from the
/// diagonals elsewhere (E13). The prior only smooths and shares; its strengths stay as given. What no step sees is zero.
Eigen::VectorXd mean_in_stages(const std::vector<CondensedLine>& lines, const std::vector<LineRows>& rows,
                               const GeometricBasis& basis, const GeometricPrior& prior, double misfit);

}  // namespace invar::metrology
