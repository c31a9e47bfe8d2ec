// Droplet trajectory: where a droplet lands that was aimed at a target from a height.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

namespace invar::metrology {

/// N droplets: target and place of landing (2 x N, m), height of the nozzle above the substrate [m]. Optional: the
/// velocity of the stage while jetting (2 x N, m/s; empty where it stood still) and the diameter [m].
struct Droplets {
  Eigen::Matrix2Xd target;
  Eigen::Matrix2Xd landed;
  Eigen::VectorXd height;
  Eigen::Matrix2Xd stage_velocity;
  Eigen::VectorXd diameter;
};

/// landed - aimed = placement + height * slope + field (aimed - field_centre)
///                  + stage_velocity * (delay + height / ejection_speed).
///
/// The field is what grows over the targets: a frame that is turned or scaled against another.
/// Linear in placement and slope (a, b) = tan(tilt) (cos azimuth, sin azimuth), in which everything is done,
/// since the azimuth is undefined at zero tilt. The thesis's theta is the elevation: tilt = 90 deg - theta
/// (docs/references.md#e23). Golden numbers: tilt 0.304 deg, azimuth 0.9739 deg, placement (2.0, 118.2) um land at
/// (12.610, 118.380) um from 2 mm and (108.102, 120.004) um from 20 mm.
struct DropletTrajectory {
  Eigen::Vector2d placement = Eigen::Vector2d::Zero();  // [m]
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();      // [m/m]
  double slowness = 0.0;                                // 1 / ejection speed [s/m]; 0: carry not identified
  double delay = 0.0;  // from trigger to droplet [s]; 0: not identified apart from the carry
  /// Covariance of (placement x, slope x), the same for y, before noise of single droplets [m, 1].
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  double slowness_sigma = std::numeric_limits<double>::infinity();
  double delay_sigma = std::numeric_limits<double>::infinity();
  Eigen::Matrix2d field = Eigen::Matrix2d::Zero();         // [m/m]; zero: none identified
  Eigen::Vector2d field_centre = Eigen::Vector2d::Zero();  // [m], where the placement holds
  /// Covariance of one row of `field`: the variance that it adds to a component at `d` from the centre is d' covariance d.
  Eigen::Matrix2d field_covariance = Eigen::Matrix2d::Zero();
  double least_height = 0.0;  // of the droplets it was identified from [m]
  double most_height = 0.0;

  /// Landed minus aimed at the centre of the field.
  [[nodiscard]] Eigen::Vector2d offset(
      double height, const Eigen::Vector2d& stage_velocity = Eigen::Vector2d::Zero()) const {
    return placement + height * slope + lead(height) * stage_velocity;
  }
  /// Part of the landing error that the field makes for a droplet aimed here.
  [[nodiscard]] Eigen::Vector2d over_field(const Eigen::Vector2d& aimed) const {
    return field * (aimed - field_centre);
  }
  /// Where to aim so that a droplet lands on the target.
  [[nodiscard]] Eigen::Vector2d aim(const Eigen::Vector2d& target, double height,
                                    const Eigen::Vector2d& stage_velocity = Eigen::Vector2d::Zero()) const;
  /// By how much earlier a moving stage has to trigger [s].
  [[nodiscard]] double lead(double height) const { return delay + height * slowness; }
  /// Standard deviation of each component of the predicted offset at rest [m].
  [[nodiscard]] double sigma(double height) const;
  /// The same for a droplet aimed here.
  [[nodiscard]] double sigma(double height, const Eigen::Vector2d& aimed) const;
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

/// Whether what a fit leaves is scatter alone: tested against a field that is curved over the targets and against
/// droplets that deviate as the one before them.
struct ScatterTest {
  bool tested = false;         // false: too few droplets
  double probability = 1.0;    // that scatter alone makes what a test found
  std::string pattern;         // what the likelier of the two would be
  double explained_rms = 0.0;  // of what is left, by the curved field [m]
};
inline constexpr double significant = 0.01;  // a pattern is said below this probability of chance

/// Form of the field: nothing, a rotation and one scale, or a rotation, two scales and a squareness.
enum class FieldForm { none, rotation_and_scale, any };

struct TrajectoryFit {
  DropletTrajectory trajectory;
  FieldForm field_form = FieldForm::none;
  double field_probability = 1.0;  // that chance alone makes the field's gain
  ScatterTest scatter;
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
/// their landing and, where measured, by their diameter). A field is identified where an F-test says so (chance below
/// 1 in 10 000). Heights closer than 1 % of the largest count as one;
/// with one height placement and tilt cannot be told apart, and the offset is predicted for that height.
TrajectoryFit identify_trajectory(const Droplets& droplets);

}  // namespace invar::metrology
