// Droplet trajectory: where a droplet lands that was aimed at a target from a height.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

namespace invar::metrology {

/// N droplets: target and place of landing (2 x N, m), height of the nozzle above the substrate [m]; optional
/// velocity of the stage while jetting (2 x N, m/s; empty where it stood still) and diameter [m] (may be empty).
struct Droplets {
  Eigen::Matrix2Xd target;
  Eigen::Matrix2Xd landed;
  Eigen::VectorXd height;
  Eigen::Matrix2Xd stage_velocity;
  Eigen::VectorXd diameter;
};

/// landed - aimed = placement + height * slope + stage_velocity * (delay + height / ejection_speed).
///
/// Linear in placement and slope (a, b) = tan(tilt) (cos azimuth, sin azimuth), in which everything is done,
/// since the azimuth is undefined at zero tilt. The seed's theta is the elevation: tilt = 90 deg - theta
/// (erratum E23). Golden numbers: tilt 0.304 deg, azimuth 0.9739 deg, placement (2.0, 118.2) um land at
/// (12.610, 118.380) um from 2 mm and (108.102, 120.004) um from 20 mm.
struct DropletTrajectory {
  Eigen::Vector2d placement = Eigen::Vector2d::Zero();  // [m]
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();      // [m/m]
  double slowness = 0.0;                                // 1 / ejection speed [s/m]; 0: carry not identified
  double delay = 0.0;  // from trigger to droplet [s]; 0: not identified apart from the carry
  /// Of (placement x, slope x), the same for y, before noise of single droplets [m, 1].
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  double slowness_sigma = std::numeric_limits<double>::infinity();
  double delay_sigma = std::numeric_limits<double>::infinity();
  double least_height = 0.0;  // of the droplets it was identified from [m]
  double most_height = 0.0;

  [[nodiscard]] Eigen::Vector2d offset(
      double height, const Eigen::Vector2d& stage_velocity = Eigen::Vector2d::Zero()) const {
    return placement + height * slope + lead(height) * stage_velocity;
  }
  /// By how much earlier a moving stage has to trigger [s].
  [[nodiscard]] double lead(double height) const { return delay + height * slowness; }
  /// Standard deviation of each component of the predicted offset at rest [m].
  [[nodiscard]] double sigma(double height) const;
  [[nodiscard]] double tilt() const;     // [rad]
  [[nodiscard]] double azimuth() const;  // [rad]
};

struct DropletStatistics {
  Eigen::Index count = 0;
  double mean = 0.0;        // [m]
  double deviation = 0.0;   // [m]
  double mean_error = 0.0;  // standard error of the mean [m]
  double within_one = 0.0;  // share within one standard deviation
  double within_two = 0.0;
  double anderson_darling = 0.0;
  double probability = 1.0;  // of such a statistic from a normal distribution
};
/// Needs eight diameters at least.
DropletStatistics droplet_statistics(const Eigen::Ref<const Eigen::VectorXd>& diameters);

struct TrajectoryFit {
  DropletTrajectory trajectory;
  double scatter_at_nozzle = 0.0;   // s0 of var = s0^2 + (s1 h)^2, one component [m]
  double scatter_per_height = 0.0;  // s1 [m/m]
  Eigen::VectorXd kept;             // 1, or 0 for a satellite
  Eigen::Matrix2Xd residual;        // landed minus predicted [m]
  double before_rms = 0.0;          // length of landed minus target, droplets kept [m]
  double after_rms = 0.0;           // with each height's droplets left out where there are more than two [m]
  double tilt_sigma = std::numeric_limits<double>::infinity();     // [rad]
  double azimuth_sigma = std::numeric_limits<double>::infinity();  // [rad]
  std::vector<std::string> unidentified;
  std::vector<std::string> notes;
};

/// Robust weighted least squares: droplets weighted by the scatter of their height, satellites rejected (by
/// their landing and, where measured, by their diameter). Heights closer than 1 % of the largest count as one;
/// with one height placement and tilt cannot be told apart, and the offset is predicted for that height.
TrajectoryFit identify_trajectory(const Droplets& droplets);

}  // namespace invar::metrology
