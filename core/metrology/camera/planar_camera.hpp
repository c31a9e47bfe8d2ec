// A pinhole camera with lens distortion from views of a flat target (Zhang, IEEE TPAMI 22, 2000).
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

namespace invar::metrology {

/// Lens models, each with everything that the ones before it have, save that the last has no third radial term.
enum class Lens { pinhole, radial_1, radial_2, radial_3, radial_2_tangential };
inline constexpr std::array lenses{Lens::pinhole, Lens::radial_1, Lens::radial_2, Lens::radial_3,
                                   Lens::radial_2_tangential};
const char* name(Lens lens);

/// u = u0 + fx x + skew y, v = v0 + fy y with (x, y) = (X, Y) / Z bent by 1 + k1 r^2 + k2 r^4 + k3 r^6 and Brown's
/// tangential terms.
struct PinholeCamera {
  double fx = 0.0, fy = 0.0;       // px
  double u0 = 0.0, v0 = 0.0;       // px, the principal point
  double skew = 0.0;               // px
  std::array<double, 3> radial{};  // of normalised coordinates
  std::array<double, 2> tangential{};
  /// Where a point in the camera's frame [any unit] is seen [px].
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& point_in_camera) const;
};

struct TargetPose {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  // rotation vector [rad], target to camera
  Eigen::Vector3d position =
      Eigen::Vector3d::Zero();  // of the target's origin in the camera, unit of the target
};

struct ViewFit {
  TargetPose pose;
  double rms = 0.0;            // px, distance
  Eigen::Matrix2Xd residuals;  // px, seen minus projected
};

struct PlanarCalibration {
  Lens lens = Lens::pinhole;
  PinholeCamera camera;
  PinholeCamera sigma;  // standard deviation of each number
  std::vector<ViewFit> views;
  double rms = 0.0;  // px, distance, over all views
};

/// `target`: points of the target's plane, one a column; `views`: the same points as seen [px]. At least three views
/// of at least six points each, tilted differently: two parallel views tell no more than one. Nothing is returned where
/// the views do not determine the camera.
std::optional<PlanarCalibration> calibrate_planar(const Eigen::Matrix2Xd& target,
                                                  const std::vector<Eigen::Matrix2Xd>& views, Lens lens);

/// The pose alone, the camera known.
std::optional<ViewFit> fit_pose(const PinholeCamera& camera, const Eigen::Matrix2Xd& target,
                                const Eigen::Matrix2Xd& view);

/// Residual of the best map of the target's plane onto the view [px, RMS distance]: the lens, noise, and points that are wrong.
/// Infinite where there is none.
double homography_rms(const Eigen::Matrix2Xd& target, const Eigen::Matrix2Xd& view);

/// Where each point of the target is seen [px].
Eigen::Matrix2Xd project_target(const PinholeCamera& camera, const TargetPose& pose,
                                const Eigen::Matrix2Xd& target);

/// Each view left out once: the camera from the others, the pose from the view itself. RMS distance [px] a view; nothing
/// where one calibration fails.
std::optional<std::vector<double>> leave_one_view_out(const Eigen::Matrix2Xd& target,
                                                      const std::vector<Eigen::Matrix2Xd>& views, Lens lens);

}  // namespace invar::metrology
