// The thesis's fusion: weights of the sensors' positions, learned by least squares over speed, noise level and more.
#pragma once

#include <Eigen/Core>
#include <array>
#include <variant>
#include <vector>

#include "core/metrology/fusion/recursive_weights.hpp"
#include "core/metrology/fusion/sensor_fusion.hpp"
#include "core/numerics/lookup_table.hpp"
#include "core/numerics/rbf_network.hpp"

namespace invar::metrology {

/// Weights that sum to one with an intercept, from positions of N sensors (rows: samples) and the reference.
/// The constraint is built in: the columns are nearly equal, so K = (S'S)^-1 S'x follows from the error
/// covariance alone (docs/references.md#e20). Batch, by QR.
struct WeightFit {
  Eigen::VectorXd weights;  // N
  double intercept = 0.0;   // [m]
  double rms = 0.0;         // of the fused position [m]
};
WeightFit fit_weights(const Eigen::Ref<const Eigen::MatrixXd>& sensors,
                      const Eigen::Ref<const Eigen::VectorXd>& reference);

/// Noise of the first velocity sensor as a function of speed (thesis, 6.2: two models in series); logarithm of the
/// deviation [m/s], monotone and straight between the knots. No knots: noise does not follow speed.
struct NoiseBySpeed {
  std::vector<double> speed;  // ascending [m/s]
  std::vector<double> log_deviation;

  [[nodiscard]] double operator()(double at) const noexcept;  // deviation [m/s]; real-time
};

/// All products of powers of `variables` numbers up to total degree `degree`, in order of degree: the powers.
using Powers = std::array<unsigned char, most_sensors>;
std::vector<Powers> monomials(int variables, int degree);
double monomial(const Powers& powers, const std::array<double, most_sensors>& variables) noexcept;

/// Nonlinear fusion (docs/references.md#e29): x = m + sum of c_k times monomials up to `degree`. Their variables are
/// the weighted mean m and the difference of each other sensor from the first, centred and scaled. Held at the border
/// of the fitted range.
struct FusionPolynomial {
  int degree = 1;                 // 1: none
  double centre = 0.0;            // of m [m]
  double reach = 1.0;             // of m to either side [m]
  double difference_reach = 1.0;  // of the differences to either side [m]
  Eigen::VectorXd coefficients;   // [m]
};

/// The fitted selector: for each sensor but the first a network from (speed [m/s], noise level, and the run's further
/// attribute where there is one) to its weight.
struct WeightModel {
  int positions = 0;
  int velocities = 0;
  std::vector<numerics::RbfNetwork> weights;  // positions + velocities - 1
  double intercept = 0.0;                     // [m]
  std::vector<double> delays;                 // how late each sensor is [s]; positions + velocities
  std::vector<PositionSensorModel> known;     // what is known of the position sensors; may be empty
  NoiseBySpeed noise;
  FusionPolynomial polynomial;
};

/// Weights of all sensors at selectors (speed, noise level, ...): clipped to [0, 1], sum one.
Eigen::VectorXd weights_at(const WeightModel& model, const Eigen::Ref<const Eigen::VectorXd>& selectors);

/// Learning while running: what an instrument beside the sensors says moves the weights that were found before.
struct WeightLearning {
  double memory = 0.0;           // older errors count less and less [s]; 0: nothing is learnt
  double most = 0.5;             // that a weight moves
  double most_intercept = 2e-3;  // that the intercept moves [m]
};

/// Runs the weights: integrates the velocities from the first position reading and moves every sensor on by its delay.
/// The weights are looked up by the low-passed speed and the noise level. The noise level is given, or comes from the speed by
/// the model, or is estimated over a window of readings. A missing sensor loses its weight at once. A sensor that repeats
/// itself loses it after five readings, an encoder after the way of three of its steps. A sensor that leaps as no motion
/// does loses it at once, until it has agreed with the others for twenty readings; this holds for `known` sensors and
/// velocities. Where a sample has a reference, recursive least squares learns the change of weights and intercept since
/// the model was made. The change stays within bounds and is blended in with the memory, so nothing steps.
class WeightedFusion final : public FusionEstimator {
 public:
  explicit WeightedFusion(const WeightModel& model, const WeightLearning& learning = {});
  void reset() noexcept override;
  FusedPosition step(const FusionSample& sample) noexcept override;

 private:
  using Values = std::array<double, most_sensors>;
  void start(const FusionSample& sample) noexcept;
  [[nodiscard]] double travel(const FusionSample& sample) noexcept;
  void read_velocity(std::size_t i, const FusionSample& sample, FusedPosition& fused) noexcept;
  void read_position(std::size_t i, const FusionSample& sample, FusedPosition& fused) noexcept;
  [[nodiscard]] double usual_change(std::size_t i, double change) noexcept;
  [[nodiscard]] bool believed(std::size_t i, bool leapt, bool agrees) noexcept;
  void weigh(const FusionSample& sample, FusedPosition& fused) noexcept;
  void learn(const FusionSample& sample, const FusedPosition& fused) noexcept;
  [[nodiscard]] double aligned(std::size_t i, const FusionSample& sample) const noexcept;
  [[nodiscard]] double corrected(double mean, const FusedPosition& fused) const noexcept;

  WeightModel model_;
  WeightLearning learning_;
  std::size_t positions_, sensors_;
  using Table = std::variant<numerics::LookupTable<2>, numerics::LookupTable<3>>;
  std::vector<Table> tables_;
  std::vector<Powers> powers_;
  Values value_{};  // position of each sensor
  Values last_{};   // its reading
  std::array<int, most_sensors> repeats_{};
  std::array<double, most_sensors> unread_{};  // time since it was read [s]
  Values way_{};                               // moved since a position was read [m]
  Values since_{};                             // moved since it changed [m]
  std::array<bool, most_sensors> left_{};      // it stood still meanwhile, and has not changed since
  Values jitter_{};  // mean square of what two readings differ by, beside the motion [m2, m2/s2]
  std::array<int, most_sensors> readings_{};  // that are in it
  std::array<int, most_sensors> doubted_{};  // readings until a sensor that leapt is believed again; 0: it is
  RecursiveWeights recursive_;
  Values found_{};                // weights by the model
  Values shift_{};                // of the weights of the second sensor and those behind it, as learnt
  double intercept_shift_ = 0.0;  // [m]
  double step_moved_ = 0.0;       // by the first velocity sensor in this period [m]
  double fused_ = 0.0;
  double speed_ = 0.0;
  double spread_ = 0.0;
  double largest_ = 0.0;
  bool started_ = false;
  bool moving_ = false;  // the fused position has a predecessor
};

}  // namespace invar::metrology
