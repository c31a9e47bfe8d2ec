// First order: what a fit would gain if everything were linear about it, its own numbers free beside.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "core/diagnosis/candidates/start.hpp"
#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// Directions of the base's own numbers, to be taken out of every other, and how far they still have to go. A fit may end within
/// a fraction of its own uncertainty, which is not its end for an effect nearly along its numbers.
struct Nuisance {
  Eigen::MatrixXd columns;
  Eigen::LDLT<Eigen::MatrixXd> hessian;
  Eigen::VectorXd slope;
};
Nuisance nuisance(const Case& data, const Weighing& weighing, const Fit& base);

/// Change of measured - simulated along each direction of each start, a matrix a start; `at`: measured - simulated of the base.
/// Runs of one kind at one place run together; a curve of few knots is the sum of one of many that has them too.
std::vector<Eigen::MatrixXd> columns_of(const Case& data, const Fit& base, const Eigen::VectorXd& at,
                                        const std::vector<Start>& starts);

/// Slope of the cost along the columns once the base's own numbers, which share `shared` with them, have arrived.
Eigen::VectorXd slope_along(const Weighing& weighing, const Fit& base, const Nuisance& n,
                            const Eigen::MatrixXd& columns, const Eigen::MatrixXd& shared);

/// How many directions all starts have together.
std::size_t directions_of(const std::vector<Start>& starts);

}  // namespace invar::diagnosis
