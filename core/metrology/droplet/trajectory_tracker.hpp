// Trajectory tracker: follows a droplet trajectory that drifts while printing.
#pragma once

#include <Eigen/Core>

#include "core/metrology/droplet/droplet_trajectory.hpp"

namespace invar::metrology {

/// Rates at which the parameters wander (1 sigma after one second; a random walk), and their greatest distance from the
/// identified values. Beyond that distance the head needs a hand instead of a new model.
struct TrajectoryDrift {
  double placement = 2e-7;  // [m]
  double slowness = 1e-3;   // share of the slowness
  double limit = 1e-4;      // change of the offset at the height and velocity in use [m]
};

/// Kalman filter on (placement x, y; slope x, y; delay; slowness), begun from a calibration and its uncertainty.
/// One height while printing does not tell placement from tilt, and need not. Tilt and delay stand still.
class TrajectoryTracker {
 public:
  TrajectoryTracker(const TrajectoryFit& fit, const TrajectoryDrift& drift);

  /// A droplet measured `time` [s] after the calibration, at which the offset from where the nozzle stood when it
  /// was triggered is `offset` [m], without what the field adds there. False: it is no droplet of this trajectory (farther than 4 sigma) and was left out.
  /// Times never go back.
  bool add(double time, double height, const Eigen::Vector2d& stage_velocity, const Eigen::Vector2d& offset);

  /// As of the last droplet.
  [[nodiscard]] const DropletTrajectory& trajectory() const { return now_; }
  /// How far the offset has moved since the calibration [m].
  [[nodiscard]] double change(double height, const Eigen::Vector2d& stage_velocity) const;
  [[nodiscard]] bool within_limit(double height, const Eigen::Vector2d& stage_velocity) const {
    return change(height, stage_velocity) <= drift_.limit;
  }

 private:
  using State = Eigen::Matrix<double, 6, 1>;
  using Covariance = Eigen::Matrix<double, 6, 6>;

  TrajectoryDrift drift_;
  DropletTrajectory begun_;
  DropletTrajectory now_;
  double scatter_at_nozzle_;
  double scatter_per_height_;
  State state_;
  Covariance covariance_ = Covariance::Zero();
  double time_ = 0.0;
};

}  // namespace invar::metrology
