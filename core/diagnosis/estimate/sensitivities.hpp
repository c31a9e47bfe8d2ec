// Sensitivities: what many models that differ in a number or a term leave of the recordings, run side by side.
#pragma once

#include <functional>

#include "core/diagnosis/estimate/freedom.hpp"
#include "core/diagnosis/estimate/weighing.hpp"

namespace invar::diagnosis {

/// measured - simulated of each model, given to `take` with its place, in any order. Runs on all processors, and so does `take`.
void for_differences_of(const Case& data, const std::vector<physics::Model>& models,
                        const std::function<void(std::size_t, const Eigen::VectorXd&)>& take);
/// Columns: change of measured - simulated by each freedom, row by row as they stand. Runs on all processors.
Columns sensitivities(const Case& data, const physics::Model& model, const std::vector<Freedom>& free);

}  // namespace invar::diagnosis
