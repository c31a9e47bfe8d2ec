// Standard deviations from the spread between blocks of rows, where what a model leaves is no independent noise.
#pragma once

#include "core/diagnosis/estimate/fit.hpp"

namespace invar::diagnosis {

/// One sigma of each freedom of a fit: the curvature's, or the one that blocks of neighbouring rows show by how differently each
/// pulls at the numbers, whichever is larger. Cluster-robust ("sandwich") covariance: Liang and Zeger, Biometrika 73 (1986);
/// small-sample factor of Cameron and Miller, J. Human Resources 50 (2015), eq. 12. Outputs of the same rows share a block.
Eigen::VectorXd sigma_over_blocks(const Case& data, const Weighing& weighing, const Fit& fit);

}  // namespace invar::diagnosis
