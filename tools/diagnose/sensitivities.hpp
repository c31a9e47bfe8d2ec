// Sensitivities: what many models that differ in a number or a term leave of the recordings, run side by side.
#pragma once

#include <functional>

#include "tools/diagnose/fit.hpp"

namespace invar::diagnose {

/// measured - simulated of each model, given to `take` with its place, in any order. Runs on all processors, and so does `take`.
void for_differences_of(const Case& data, const std::vector<physics::Model>& models,
                        const std::function<void(std::size_t, const Eigen::VectorXd&)>& take);
/// Columns: change of measured - simulated by each freedom, row by row as they stand. Runs on all processors.
Eigen::MatrixXd sensitivities(const Case& data, const physics::Model& model,
                              const std::vector<Freedom>& free);

}  // namespace invar::diagnose
