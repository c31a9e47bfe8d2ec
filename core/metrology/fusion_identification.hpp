// Identification of both fusion estimators from runs with a reference, and the choice between them.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "core/metrology/sensor_fusion.hpp"
#include "core/metrology/weighted_fusion.hpp"

namespace invar::metrology {

/// One run from rest. N rows; NaN where a reading is missing.
struct FusionRun {
  Eigen::VectorXd time;         // [s], ascending
  Eigen::VectorXd reference;    // [m]; may be empty when only predicting
  Eigen::MatrixXd positions;    // N x P [m]
  Eigen::MatrixXd velocities;   // N x V [m/s]
  Eigen::VectorXd noise_level;  // N, or empty
};

struct FusionOptions {
  bool polynomial = false;       // try nonlinear fusion too
  bool noise_estimated = false;  // do not use noise_level
};

enum class FusionMethod { observer, weights };

/// One run as both methods fused it when it was held out.
struct HeldOut {
  double speed = 0.0;        // RMS of the run [m/s]
  double noise_level = 0.0;  // as given or estimated
  double observer = 0.0;     // RMS error [m]
  double weights = 0.0;
  double best_single = 0.0;    // of the sensor that was best on it, known only in hindsight
  std::vector<double> fitted;  // weights that least squares gives this run, in the order of the sensors
};

struct FusionFit {
  FusionModel sensors;
  WeightModel weights;
  FusionMethod method = FusionMethod::observer;
  std::vector<HeldOut> held_out;
  double observer_rms = 0.0;  // over the held-out runs [m]
  double weights_rms = 0.0;
  double polynomial_rms = 0.0;  // 0: not tried
  int degree = 1;
  std::vector<std::string> unidentified;
  std::vector<std::string> notes;
};

/// The structure of each sensor (step, offset, delay, hysteresis; gain over speed, lag, correlation of noise).
FusionModel identify_sensors(const std::vector<FusionRun>& runs, std::vector<std::string> position_names,
                             std::vector<std::string> velocity_names, std::vector<std::string>* unidentified);

/// The seed's weights: least squares for each run, then a network over speed and noise level.
WeightModel identify_weights(const std::vector<FusionRun>& runs, int degree = 1);

/// Both, three-fold cross-validated over whole runs; the method with the smaller held-out error is chosen.
FusionFit identify_fusion(const std::vector<FusionRun>& runs, const std::vector<std::string>& position_names,
                          const std::vector<std::string>& velocity_names, const FusionOptions& options);

/// Every row of a run through an estimator (which is reset first).
std::vector<FusedPosition> fuse(FusionEstimator& estimator, const FusionRun& run);

/// Noise of a velocity from its second differences, over the largest reading, times sqrt(3): the contract's
/// level for uniform noise.
double estimated_noise_level(const Eigen::Ref<const Eigen::VectorXd>& velocity);

}  // namespace invar::metrology
