#include "core/vision/pinhole_view.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

namespace invar::vision {

namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// The plane's axes in the camera's frame: x as the image's x, y across it and down.
Eigen::Matrix<double, 3, 2> axes_of(const Vector3d& normal) {
  const Vector3d x = (Vector3d::UnitX() - normal.x() * normal).normalized();
  Eigen::Matrix<double, 3, 2> axes;
  axes << x, normal.cross(x);
  return axes;
}

/// What project() changes by for small steps in (x, y) / z.
Matrix2d slope_of(const metrology::PinholeCamera& camera, const Vector2d& direction) {
  constexpr double step = 1e-6;
  Matrix2d slope;
  for (int k = 0; k < 2; ++k) {
    Vector2d up = direction, down = direction;
    up(k) += step, down(k) -= step;
    slope.col(k) = (camera.project(up.homogeneous()) - camera.project(down.homogeneous())) / (2.0 * step);
  }
  return slope;
}

}  // namespace

Vector2d direction_of(const metrology::PinholeCamera& camera, const Vector2d& seen) {
  const double y = (seen.y() - camera.v0) / camera.fy;
  Vector2d at{(seen.x() - camera.u0 - camera.skew * y) / camera.fx, y};
  Vector2d best = at;
  double nearest = (camera.project(at.homogeneous()) - seen).norm();
  for (int round = 0; round < 30 && nearest > 1e-10; ++round) {
    const Matrix2d slope = slope_of(camera, at);
    if (!(std::abs(slope.determinant()) > 1e-6 * camera.fx * camera.fy)) break;  // the lens folds over
    at += slope.inverse() * (seen - camera.project(at.homogeneous()));
    const double apart = (camera.project(at.homogeneous()) - seen).norm();
    if (!(apart < nearest)) break;
    nearest = apart;
    best = at;
  }
  return best;
}

Vector2d PinholeView::to_plane(const Vector2d& seen) const {
  const Vector3d foot{0.0, 0.0, distance};
  const Vector3d ray = direction_of(camera, seen).homogeneous();
  const Vector3d point = ray * (normal.dot(foot) / normal.dot(ray));
  return axes_of(normal).transpose() * (point - foot);
}

std::optional<Vector2d> PinholeView::to_pixels(const Vector2d& on_plane) const {
  const Vector3d point = Vector3d{0.0, 0.0, distance} + axes_of(normal) * on_plane;
  if (!(point.z() > 0.0)) return std::nullopt;
  return camera.project(point);
}

double PinholeView::scale() const {
  return distance / std::sqrt(camera.fx * camera.fy * std::abs(normal.z()));
}

}  // namespace invar::vision
