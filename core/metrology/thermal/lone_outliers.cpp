#include "core/metrology/thermal/lone_outliers.hpp"

#include <cmath>
#include <map>
#include <numeric>

#include "core/base/contract.hpp"

namespace invar::metrology {

namespace {

constexpr int least_stretch = 3;    // readings: two alike may be chance
constexpr double most_ratio = 2.0;  // of the sizes of neighbours in a stretch

/// Groups of readings that belong together.
class Groups {
 public:
  explicit Groups(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0U); }
  std::size_t of(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) { parent_[of(a)] = of(b); }

 private:
  std::vector<std::size_t> parent_;
};

}  // namespace

LoneOutliers lone_outliers(const Eigen::VectorXd& residual, const std::vector<int>& place, double limit) {
  const std::size_t n = place.size();
  INVAR_EXPECTS(static_cast<std::size_t>(residual.size()) == n, n);
  const auto at = [&](std::size_t i) { return residual(static_cast<Eigen::Index>(i)); };
  const auto beyond = [&](std::size_t i) { return !(std::abs(at(i)) <= limit); };
  const auto alike = [&](std::size_t a, std::size_t b) {
    const double ratio = at(a) / at(b);
    return beyond(a) && beyond(b) && ratio >= 1.0 / most_ratio && ratio <= most_ratio;
  };
  Groups groups{n};
  std::map<int, std::size_t> visited;
  for (std::size_t i = 0; i < n; ++i) {
    if (i > 0 && alike(i, i - 1)) groups.join(i, i - 1);
    const auto [before, first] = visited.try_emplace(place[i], i);
    if (!first && alike(i, before->second)) groups.join(i, before->second);
    before->second = i;
  }
  std::vector<int> size(n, 0);
  for (std::size_t i = 0; i < n; ++i) ++size[groups.of(i)];
  LoneOutliers result;
  result.weights = Eigen::VectorXd::Ones(residual.size());
  for (std::size_t i = 0; i < n; ++i) {
    if (!beyond(i)) continue;
    const bool stretch = size[groups.of(i)] >= least_stretch;
    if (!stretch) result.weights(static_cast<Eigen::Index>(i)) = 0.0;
    (stretch ? result.in_stretches : result.outliers) += 1;
  }
  return result;
}

}  // namespace invar::metrology
