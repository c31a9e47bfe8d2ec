// From pixels to metres: the scale of a camera that looks straight down, with radial distortion and unequal pixels.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/vision/pinhole_view.hpp"

namespace invar::vision {

/// ideal = centre + (seen - centre) (1 + distortion |seen - centre|^2); metres = scale * (ideal x, aspect * ideal y).
/// Metres count from the centre of the top left pixel's place, x right, y down. A pinhole camera with its plane takes the
/// place of all that: metres in its plane, shifted so that they count from about the top left pixel too.
struct CameraModel {
  double scale = 0.0;        // m/px, at the centre of the image
  double scale_sigma = 0.0;  // m/px, standard deviation
  double aspect = 1.0;       // scale along y over scale along x
  double aspect_sigma = 0.0;
  double distortion = 0.0;  // 1/px^2
  double distortion_sigma = 0.0;
  int width = 0, height = 0;                         // px; of the images that it holds for; 0: not known
  Eigen::Vector2d center = Eigen::Vector2d::Zero();  // px; of the distortion: the middle of the image
  std::optional<PinholeView> pinhole{};  // `scale` is that at its principal point, which is `center`

  /// A point of the image as it is [px] on the object [m].
  [[nodiscard]] Eigen::Vector2d to_metres(const Eigen::Vector2d& seen) const;
  /// Metres for one pixel at a point, as the root of the area scale.
  [[nodiscard]] double local_scale(const Eigen::Vector2d& seen) const;
  /// The inverse of to_metres [px]; nothing where the lens maps no pixel there.
  [[nodiscard]] std::optional<Eigen::Vector2d> to_pixels(const Eigen::Vector2d& metres) const;
};

}  // namespace invar::vision
