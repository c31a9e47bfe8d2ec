#include "core/vision/ruler_file.hpp"

#include "core/config/yaml.hpp"

namespace invar::vision {

std::vector<RulerMark> read_ruler(const std::filesystem::path& file) {
  const auto yaml = config::Yaml::load(file);
  const config::Node circles = yaml.root().required("circles");
  std::vector<RulerMark> ruler;
  if (circles.exists() && !circles.is_list())
    circles.fault("is no list", "write circles: [{radius: 5.0e-4}, ...]");
  if (circles.is_list())
    for (const config::Node& circle : circles.children()) {
      RulerMark mark{circle.number("radius", "m", Range{1e-9, 10.0})};
      if (circle.has("at")) {
        const auto at = circle["at"].as_numbers("m");
        if (at.size() == 2)
          mark.at = {at[0], at[1]};
        else
          circle["at"].fault("has " + std::to_string(at.size()) + " numbers", "give x and y");
      }
      ruler.push_back(mark);
    }
  if (circles.is_list() && ruler.empty())
    circles.fault("lists no circle", "give the radius of each circle of the ruler");
  yaml.finish();
  return ruler;
}

std::vector<double> radii_of(const std::vector<RulerMark>& ruler) {
  std::vector<double> radii;
  for (const RulerMark& mark : ruler) radii.push_back(mark.radius);
  return radii;
}

}  // namespace invar::vision
