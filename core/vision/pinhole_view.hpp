// PinholeView: a pinhole camera that looks at a flat substrate, from its pixels to metres on that plane and back.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/metrology/camera/planar_camera.hpp"

namespace invar::vision {

/// The plane is `normal` . point = normal . (0, 0, distance) in the camera's frame (z along the optical axis). Metres count in
/// the plane from where the optical axis meets it, x as the image's x there, y down.
struct PinholeView {
  metrology::PinholeCamera camera;
  double distance = 0.0;                              // m, along the optical axis
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // of length 1, away from the camera

  [[nodiscard]] Eigen::Vector2d to_plane(const Eigen::Vector2d& seen) const;
  /// The inverse [px]; nothing behind the camera.
  [[nodiscard]] std::optional<Eigen::Vector2d> to_pixels(const Eigen::Vector2d& on_plane) const;
  /// Metres for one pixel where the optical axis meets the plane, as the root of the area scale.
  [[nodiscard]] double scale() const;
};

/// A pixel's direction (x, y) / z, without the lens: Newton's method on `PinholeCamera::project`.
[[nodiscard]] Eigen::Vector2d direction_of(const metrology::PinholeCamera& camera,
                                           const Eigen::Vector2d& seen);

}  // namespace invar::vision
