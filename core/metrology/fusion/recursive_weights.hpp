// RecursiveWeights: the weights of several sensors beside a reference, learnt sample by sample.
#pragma once

#include <Eigen/Core>

#include "core/metrology/fusion/sensor_fusion.hpp"

namespace invar::metrology {

/// Recursive least squares of weights that sum to one, and an intercept. After all samples of a batch, each counting alike, it
/// has what `fit_weights` finds. Real-time: neither allocates nor throws.
class RecursiveWeights {
 public:
  explicit RecursiveWeights(std::size_t sensors);  // at most `most_sensors`
  void reset() noexcept;
  /// One sample: positions by all sensors and the reference [m]. `keep` in (0, 1]: how much of what was learnt before still
  /// counts; 1: all alike.
  void add(const std::array<double, most_sensors>& sensors, double reference, double keep = 1.0) noexcept;
  [[nodiscard]] double weight(std::size_t sensor) const noexcept;
  [[nodiscard]] double intercept() const noexcept { return theta_(theta_.size() - 1); }

 private:
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, static_cast<int>(most_sensors), 1>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, static_cast<int>(most_sensors),
                               static_cast<int>(most_sensors)>;
  Vector theta_;  // weights of sensors 2..N, intercept
  Matrix covariance_;
};

}  // namespace invar::metrology
