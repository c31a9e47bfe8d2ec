// What is asked of droplets that were found, without their picture.
#include <algorithm>
#include <cmath>

#include "core/vision/annotate.hpp"
#include "core/vision/droplets.hpp"

namespace invar::vision {

double Shape::equal_area_radius() const {
  return std::sqrt(radius * radius + 0.5 * (cos2 * cos2 + sin2 * sin2));
}

double Shape::axis_ratio() const {
  const double amplitude = std::hypot(cos2, sin2);
  return (radius - amplitude) / (radius + amplitude);
}

std::string_view name(DropletStatus status) {
  switch (status) {
    case DropletStatus::ok:
      return "ok";
    case DropletStatus::satellite:
      return "satellite";
    case DropletStatus::cut:
      return "cut";
    case DropletStatus::dust:
      return "dust";
  }
  return "dust";
}

std::size_t Droplets::sound() const {
  return static_cast<std::size_t>(std::count_if(
      droplets.begin(), droplets.end(), [](const Droplet& d) { return d.status == DropletStatus::ok; }));
}

void point_at_nearest(std::vector<AnnotatedTarget>& targets, const Droplets& droplets, double reach) {
  for (AnnotatedTarget& target : targets) {
    double nearest = reach;
    for (const Droplet& drop : droplets.droplets) {
      const double away = std::hypot(drop.x - target.x, drop.y - target.y);
      if (drop.status == DropletStatus::ok && away < nearest)
        nearest = away, target.to_x = drop.x, target.to_y = drop.y;
    }
  }
}

}  // namespace invar::vision
