#include "components/vision/camera_file.hpp"

#include <array>
#include <cmath>
#include <cstdio>

#include "core/compensation/model_file.hpp"
#include "core/config/yaml.hpp"

namespace invar::vision {

namespace {

std::string digits(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.10g", value);
  return text.data();
}

}  // namespace

CameraModel read_camera(const std::filesystem::path& file) {
  const auto yaml = config::Yaml::load(file);
  compensation::check_seal(yaml);
  const config::Node root = yaml.root();
  if (root.has("invar_camera")) (void)root.integer("invar_camera", 1, 1);
  if (root.has("model") && root["model"].as_text() != "scale")
    root["model"].fault("this model has no scale by itself", "give a camera calibrated by a ruler");
  if (root.has("note")) root["note"].accept_all();
  CameraModel camera;
  if (root.has("image")) {
    camera.width = static_cast<int>(root["image"].integer("width", 1, 100'000));
    camera.height = static_cast<int>(root["image"].integer("height", 1, 100'000));
  }
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

std::string camera_yaml(const CameraModel& camera) {
  std::string text = "invar_camera: 1\nmodel: scale\n";
  if (camera.width > 0)
    text += "image: {width: " + std::to_string(camera.width) + ", height: " + std::to_string(camera.height) +
            "}  # px\n";
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
  return text + "checksum: \"" + compensation::checksum(text) + "\"\n";
}

}  // namespace invar::vision
