#include "core/vision/camera.hpp"

#include <cmath>

namespace invar::vision {

using Eigen::Vector2d;

Vector2d CameraModel::to_metres(const Vector2d& seen) const {
  if (pinhole) return scale * center + pinhole->to_plane(seen);
  const Vector2d away = seen - center;
  const Vector2d ideal = center + away * (1.0 + distortion * away.squaredNorm());
  return {scale * ideal.x(), scale * aspect * ideal.y()};
}

double CameraModel::local_scale(const Vector2d& seen) const {
  if (pinhole) {
    const Vector2d x{0.5, 0.0}, y{0.0, 0.5};
    const Vector2d by_x = to_metres(seen + x) - to_metres(seen - x),
                   by_y = to_metres(seen + y) - to_metres(seen - y);
    return std::sqrt(std::abs(by_x.x() * by_y.y() - by_x.y() * by_y.x()));
  }
  const double bend = distortion * (seen - center).squaredNorm();
  return scale * std::sqrt(std::abs(aspect * (1.0 + bend) * (1.0 + 3.0 * bend)));
}

std::optional<Vector2d> CameraModel::to_pixels(const Vector2d& metres) const {
  if (pinhole) return pinhole->to_pixels(metres - scale * center);
  const Vector2d ideal{metres.x() / scale, metres.y() / (scale * aspect)};
  const Vector2d away = ideal - center;
  // r (1 + k r^2) = q by Newton's method; it has an end where the lens folds over (1 + 3 k r^2 = 0).
  const double q = away.norm();
  double r = q;
  for (int i = 0; i < 50; ++i) {
    const double slope = 1.0 + 3.0 * distortion * r * r;
    if (!(slope > 0.0)) return std::nullopt;
    const double step = (r * (1.0 + distortion * r * r) - q) / slope;
    r -= step;
    if (std::abs(step) < 1e-12 * (1.0 + q)) break;
  }
  if (std::abs(r * (1.0 + distortion * r * r) - q) > 1e-9 * (1.0 + q)) return std::nullopt;
  return q > 0.0 ? Vector2d{center + away * (r / q)} : ideal;
}

}  // namespace invar::vision
