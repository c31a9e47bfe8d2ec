#include "components/vision/observe.hpp"

#include <algorithm>
#include <cmath>

#include "components/vision/annotate.hpp"

namespace invar::vision {

Observation observe(const cv::Mat& frame, const CameraModel& camera) {
  Observation out;
  out.droplets = measure_droplets(gray(frame));
  for (const Droplet& drop : out.droplets.droplets) {
    if (drop.status != DropletStatus::ok) continue;
    const Eigen::Vector2d seen{drop.x, drop.y}, at = camera.to_metres(seen);
    const double scale = camera.local_scale(seen);
    out.observed.push_back({at.x(), at.y(), 2.0 * drop.radius * scale, drop.sigma * scale, drop.score});
  }
  return out;
}

cv::Mat annotate(const cv::Mat& frame, const Observation& observation, const CameraModel& camera,
                 const std::vector<Eigen::Vector2d>& targets, double reach, double exaggeration) {
  std::vector<AnnotatedTarget> drawn;
  for (const Eigen::Vector2d& target : targets) {
    const auto seen = camera.to_pixels(target);
    if (!seen) continue;
    AnnotatedTarget t{seen->x(), seen->y(), seen->x(), seen->y(), exaggeration};
    double nearest = reach;
    for (const Droplet& drop : observation.droplets.droplets) {
      const double away = std::hypot(drop.x - seen->x(), drop.y - seen->y());
      if (drop.status == DropletStatus::ok && away < nearest)
        nearest = away, t.to_x = drop.x, t.to_y = drop.y;
    }
    drawn.push_back(t);
  }
  return annotate(gray(frame), observation.droplets, drawn);
}

}  // namespace invar::vision
