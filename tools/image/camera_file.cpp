#include "tools/image/camera_file.hpp"

#include <array>
#include <cmath>
#include <cstdio>

#include "core/config/yaml.hpp"

namespace invar::tools {

namespace {

std::string digits(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.10g", value);
  return text.data();
}

}  // namespace

vision::CameraModel read_camera(const std::filesystem::path& file) {
  const auto yaml = config::Yaml::load(file);
  const config::Node root = yaml.root();
  if (root.has("invar_camera")) (void)root.integer("invar_camera", 1, 1);
  if (root.has("image")) root["image"].accept_all();
  if (root.has("model") && root["model"].as_text() != "scale")
    root["model"].fault("`" + root["model"].as_text() + "` has no scale by itself",
                        "give a camera calibrated by a ruler");
  if (root.has("note")) root["note"].accept_all();
  vision::CameraModel camera;
  const config::Quantity scale = root.required("scale").as_quantity("m/px", Range{1e-12, 1.0});
  camera.scale = scale.value;
  camera.scale_sigma = scale.sigma.value_or(0.0);
  if (root.has("aspect")) {
    const config::Quantity aspect = root["aspect"].as_quantity("1", Range{0.5, 2.0});
    camera.aspect = aspect.value;
    camera.aspect_sigma = aspect.sigma.value_or(0.0);
  }
  if (root.has("distortion")) {
    const config::Node lens = root["distortion"];
    const config::Quantity radial = lens.required("radial").as_quantity("1/px2", Range{-1e-2, 1e-2});
    camera.distortion = radial.value;
    camera.distortion_sigma = radial.sigma.value_or(0.0);
    const auto center = lens.required("center").as_numbers("px");
    if (center.size() == 2) {
      camera.center = {center[0], center[1]};
    } else if (lens.has("center")) {
      lens["center"].fault("has " + std::to_string(center.size()) + " numbers", "give x and y");
    }
  }
  yaml.finish();
  return camera;
}

std::string camera_yaml(const vision::CameraModel& camera, int width, int height) {
  std::string text = "invar_camera: 1\nmodel: scale\nimage: {width: " + std::to_string(width) +
                     ", height: " + std::to_string(height) + "}  # px\n";
  text +=
      "scale: {value: " + digits(camera.scale) + ", unit: m/px, sigma: " + digits(camera.scale_sigma) + "}\n";
  if (camera.aspect != 1.0)
    text += "aspect: {value: " + digits(camera.aspect) +
            ", unit: \"1\", sigma: " + digits(camera.aspect_sigma) +
            "}  # scale along y over scale along x\n";
  if (camera.distortion != 0.0)
    text +=
        "distortion:  # ideal = center + (seen - center) (1 + radial |seen - center|^2)\n  radial: {value: " +
        digits(camera.distortion) + ", unit: 1/px2, sigma: " + digits(camera.distortion_sigma) +
        "}\n  center: [" + digits(camera.center.x()) + ", " + digits(camera.center.y()) + "]  # px\n";
  return text;
}

}  // namespace invar::tools
