// Outliers: readings that stand alone, a slip of the instrument and nothing that the machine did.
#pragma once

#include <vector>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Marks lone values far from their neighbours in the residual (measured - simulated) as unusable and counts them.
void drop_outliers(Case& data, const std::vector<physics::Outputs>& simulated);
/// The same from the readings `as_read`, for a model that lies nearer: a number of the user's that is far off hides what
/// stands alone, or makes it up. For plants whose outputs follow row by row; of equations more is found, none given back;
/// others keep what was found.
void drop_outliers_anew(Case& data, const Case& as_read, const std::vector<physics::Outputs>& simulated);

}  // namespace invar::diagnosis
