// The seed's fusion: weights of the sensors' positions, learned by least squares over speed and noise level.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/metrology/sensor_fusion.hpp"
#include "core/numerics/lookup_table.hpp"
#include "core/numerics/rbf_network.hpp"

namespace invar::metrology {

/// Weights that sum to one with an intercept, from positions of N sensors (rows: samples) and the reference:
/// the constraint is built in, since the columns are nearly equal and K = (S'S)^-1 S'x is set by the error
/// covariance alone (errata E20). Batch, by QR.
struct WeightFit {
  Eigen::VectorXd weights;  // N
  double intercept = 0.0;   // [m]
  double rms = 0.0;         // of the fused position [m]
};
WeightFit fit_weights(const Eigen::Ref<const Eigen::MatrixXd>& sensors,
                      const Eigen::Ref<const Eigen::VectorXd>& reference);

/// The same, sample by sample with exponential forgetting (recursive least squares). Real-time: sizes are
/// fixed when it is built.
class RecursiveWeights {
 public:
  /// `forgetting` in (0, 1]: 1 keeps all samples alike.
  explicit RecursiveWeights(Eigen::Index sensors, double forgetting = 1.0);
  void add(const Eigen::Ref<const Eigen::VectorXd>& sensors, double reference) noexcept;
  [[nodiscard]] Eigen::VectorXd weights() const;
  [[nodiscard]] double intercept() const { return theta_(theta_.size() - 1); }

 private:
  double forgetting_;
  Eigen::VectorXd theta_;  // weights of sensors 2..N, intercept
  Eigen::MatrixXd covariance_;
  Eigen::VectorXd row_;
  Eigen::VectorXd gain_;
};

/// The fitted selector: for each sensor but the first a network from (speed [m/s], noise level) to its weight.
struct WeightModel {
  int positions = 0;
  int velocities = 0;
  std::vector<numerics::RbfNetwork> weights;  // positions + velocities - 1
  double intercept = 0.0;                     // [m]
  // Nonlinear fusion (erratum E29): x = sum of c_pq m^p d^q, p + q <= degree, of the weighted mean m and each
  // difference d, scaled; empty for linear fusion.
  int degree = 1;
  double scale = 1.0;  // of m and d [m]
  Eigen::VectorXd polynomial;
};

/// Weights of all sensors at a speed and noise level: clipped to [0, 1], sum one.
Eigen::VectorXd weights_at(const WeightModel& model, double speed, double noise_level);

/// All monomials m^p d^q with p + q <= degree, in order of p + q.
Eigen::VectorXd monomials(double m, double d, int degree);

/// Runs the weights: integrates the velocities from the first position reading, looks the weights up by the
/// low-passed speed and the noise level. A sensor that is missing or repeats itself loses its weight.
class WeightedFusion final : public FusionEstimator {
 public:
  explicit WeightedFusion(const WeightModel& model);
  void reset() noexcept override;
  FusedPosition step(const FusionSample& sample) noexcept override;

 private:
  WeightModel model_;
  std::vector<numerics::LookupTable<2>> tables_;
  std::array<double, most_sensors> integral_{};
  std::array<double, 2 * most_sensors> last_{};
  std::array<int, 2 * most_sensors> repeats_{};
  double moved_ = 0.0;  // by the velocities since each position last changed [m]
  double fused_ = 0.0;
  double speed_ = 0.0;
  double spread_ = 0.0;
  double largest_ = 0.0;
  bool started_ = false;
};

}  // namespace invar::metrology
