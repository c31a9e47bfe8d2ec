// Priors: the cost of what the user believes of each free number, its slope and its curvature.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/diagnosis/estimate/freedom.hpp"

namespace invar::diagnosis {

/// -log of the prior density, up to a constant.
double cost_of_priors(const physics::Model& model, const std::vector<Freedom>& free);
/// Derivative of that cost by each free number.
Eigen::VectorXd slope_of_priors(const physics::Model& model, const std::vector<Freedom>& free);
/// Adds the second derivatives of Gaussian priors that have the same slope.
void add_curvature_of_priors(const physics::Model& model, const std::vector<Freedom>& free,
                             Eigen::MatrixXd& hessian);

}  // namespace invar::diagnosis
