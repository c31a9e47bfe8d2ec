// How a camera hangs over the stage: from its image to machine coordinates and back.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "core/vision/camera.hpp"

namespace invar::vision {

/// The optical axis is upright. Machine coordinates of a point on the substrate: where the stage stands when that point is
/// under the tool (the nozzle).
struct CameraMount {
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();  // m; of the image's centre from the tool
  double rotation = 0.0;  // rad; of the image's x about the machine's, counter-clockwise

  /// From `away`, metres from the image's centre (x right, y down), with the stage at `stage`.
  [[nodiscard]] Eigen::Vector2d to_machine(const Eigen::Vector2d& away, const Eigen::Vector2d& stage) const {
    const double c = std::cos(rotation), s = std::sin(rotation);
    return stage + offset + Eigen::Vector2d{c * away.x() + s * away.y(), s * away.x() - c * away.y()};
  }
  /// The inverse: metres from the image's centre.
  [[nodiscard]] Eigen::Vector2d from_machine(const Eigen::Vector2d& point,
                                             const Eigen::Vector2d& stage) const {
    const double c = std::cos(rotation), s = std::sin(rotation);
    const Eigen::Vector2d away = point - stage - offset;
    return {c * away.x() + s * away.y(), s * away.x() - c * away.y()};
  }

  void describe(auto& p) {
    p(offset.x(), "x", "m", {-1.0, 1.0}, "offset of the image's centre from the tool");
    p(offset.y(), "y", "m", {-1.0, 1.0}, "offset of the image's centre from the tool");
    p(rotation, "rotation", "rad", {-7.0, 7.0}, "rotation of the image's x about the machine's");
  }
};

}  // namespace invar::vision
