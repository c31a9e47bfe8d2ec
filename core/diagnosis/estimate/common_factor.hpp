// A factor that no recording can tell: all forces of an axis, or all heat flows and capacities of a body, times one number.
#pragma once

#include <functional>
#include <vector>

#include "core/diagnosis/estimate/freedom.hpp"

namespace invar::diagnosis {

/// Which of the numbers go with the factor; empty where the model has none to choose: another plant, or one of those numbers
/// is known exactly.
std::vector<bool> with_common_factor(const physics::Model& model, const std::vector<Freedom>& free);

/// Multiplies those numbers by the factor that `prior_cost` of the model likes best, and returns it: 1 where that gains less
/// than one nat. The outputs of the model stay as they were.
double take_common_factor(physics::Model& model, const std::vector<Freedom>& free,
                          const std::function<double(const physics::Model&)>& prior_cost);

}  // namespace invar::diagnosis
