#include "components/vision/simulated_camera.hpp"

#include <cmath>

#include "core/base/fault.hpp"
#include "core/vision/library.hpp"

namespace invar::vision {

SimulatedCamera::SimulatedCamera(const Parameters& parameters)
    : FrameCamera{parameters.camera}, parameters_{parameters} {
  if (parameters.width * parameters.height > 2097152)
    throw InputError{"width", "times `height` is above 2097152 px, which a frame holds", "lower one"};
  if (!parameters.ruler) return;
  if (parameters.ruler->position.size() != 2)
    throw InputError{"ruler.position", "needs two numbers", "give x and y"};
  if (parameters.ruler->file.empty()) throw InputError{"ruler.file", "missing", "name ruler.yaml"};
  const Eigen::Vector2d zero{parameters.ruler->position[0], parameters.ruler->position[1]};
  for (const RulerMark& mark : read_ruler(parameters.ruler->file))
    marks_.push_back({zero + mark.at, mark.radius});
}

void SimulatedCamera::configure() { (void)library(); }

void SimulatedCamera::activate() {
  FrameCamera::activate();
  drops_.clear();
  substrate_number_ = 0;
}

void SimulatedCamera::watch() {
  const auto lies_now = [&](std::uint64_t number) {
    if (number > substrate_number_) {
      drops_.clear();
      substrate_number_ = number;
    }
    return number == substrate_number_;
  };
  dispensing::LandedDroplet droplet;
  while (landed_.take(droplet))
    if (lies_now(droplet.substrate()))
      drops_.push_back({{droplet.position()[0], droplet.position()[1]}, 0.5 * droplet.diameter()});
  if (const auto* substrate = substrate_.latest()) (void)lies_now(substrate->number());
}

bool SimulatedCamera::take_picture(const Tick&, std::uint64_t number, Picture& picture) {
  Eigen::Vector2d stage = Eigen::Vector2d::Zero();
  if (const auto* tool = tool_.latest()) stage = {tool->position()[0], tool->position()[1]};
  Scene scene = parameters_.look;
  scene.width = static_cast<int>(parameters_.width);
  scene.height = static_cast<int>(parameters_.height);
  scene.dust = static_cast<int>(parameters_.dust);
  scene.seed = static_cast<std::uint64_t>(parameters_.seed) * 1'000'003U + number;
  const Eigen::Vector2d middle{0.5 * (scene.width - 1), 0.5 * (scene.height - 1)};
  for (const auto* spots : {&drops_, &marks_})
    for (const Spot& spot : *spots) {
      const Eigen::Vector2d at = middle + parameters_.mount.from_machine(spot.at, stage) / parameters_.scale;
      const double radius = spot.radius / parameters_.scale,
                   margin = 1.3 * radius + 0.25 * scene.width;  // the lens bends
      if (at.x() < -margin || at.y() < -margin || at.x() > scene.width + margin ||
          at.y() > scene.height + margin)
        continue;
      scene.discs.push_back({.x = at.x(), .y = at.y(), .radius = radius});
    }
  picture.pixels = library().render(scene);
  return true;
}

}  // namespace invar::vision
