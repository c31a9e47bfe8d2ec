// Lone outliers: readings that stand alone far from a model, told from stretches that the model does not explain.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace invar::metrology {

struct LoneOutliers {
  Eigen::VectorXd weights;  // 0 for a lone outlier, 1 for all others
  Eigen::Index outliers = 0;
  Eigen::Index in_stretches = 0;  // readings beyond the limit that belong to a stretch, weight 1
};

/// Judges residuals in the order of measurement, each at a numbered place. Two readings beyond `limit` belong together where they
/// follow one another, or are consecutive visits of one place, and deviate alike (one sign, sizes within a factor of
/// two). Three or more that belong together are a stretch. Glitches differ from one another, a
/// transient goes on.
LoneOutliers lone_outliers(const Eigen::VectorXd& residual, const std::vector<int>& place, double limit);

}  // namespace invar::metrology
