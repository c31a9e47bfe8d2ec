// FusionRun: one recorded run of all sensors of an axis beside its reference, and what is read off it directly.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/metrology/fusion/sensor_fusion.hpp"

namespace invar::metrology {

/// One run from rest. N rows; NaN where a reading is missing.
struct FusionRun {
  Eigen::VectorXd time;         // [s], ascending
  Eigen::VectorXd reference;    // [m]; may be empty when only predicting
  Eigen::MatrixXd positions;    // N x P [m]
  Eigen::MatrixXd velocities;   // N x V [m/s]
  Eigen::VectorXd noise_level;  // N, or empty
  Eigen::VectorXd selector;     // N, a further attribute that weights may depend on, or empty
};

struct Motion {
  Eigen::VectorXd velocity;      // [m/s]
  Eigen::VectorXd acceleration;  // [m/s2]
};

/// Velocity and acceleration of the reference: a parabola through five rows around each.
Motion motion_of(const FusionRun& run);

/// Positions of all sensors, velocities integrated from the first position reading (trapezoids): N x (P + V).
Eigen::MatrixXd integrated(const FusionRun& run);

/// Rows where every sensor reads.
std::vector<Eigen::Index> complete_rows(const Eigen::MatrixXd& sensors);

double typical_speed(const Motion& motion);
/// The noise level as recorded, else as estimated from the first velocity sensor.
double run_noise(const FusionRun& run);

/// Noise of a velocity from its second differences, over the largest reading, times sqrt(3): the contract's
/// level for uniform noise.
double estimated_noise_level(const Eigen::Ref<const Eigen::VectorXd>& velocity);

/// Every row of a run through an estimator (which is reset first).
std::vector<FusedPosition> fuse(FusionEstimator& estimator, const FusionRun& run);
double rms_error(const std::vector<FusedPosition>& fused, const FusionRun& run);

}  // namespace invar::metrology
