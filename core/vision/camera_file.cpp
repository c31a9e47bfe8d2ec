#include "core/vision/camera_file.hpp"

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

constexpr const char* pinhole_names[] = {"fx", "fy", "u0", "v0", "skew", "k1", "k2", "k3", "p1", "p2"};

std::array<double, 10> numbers_of(const metrology::PinholeCamera& c) {
  return {c.fx,           c.fy, c.u0, c.v0, c.skew, c.radial[0], c.radial[1], c.radial[2], c.tangential[0],
          c.tangential[1]};
}

/// Its numbers, and the standard deviation of fx.
metrology::PinholeCamera read_pinhole(const config::Node& node, double& fx_sigma) {
  std::array<double, 10> values{};
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Range range = k < 2 ? Range{1e-3, 1e7} : k < 5 ? Range{-1e6, 1e6} : Range{-1e3, 1e3};
    if (k >= 4 && !node.has(pinhole_names[k])) continue;  // a term that the lens does not have
    const auto quantity = node.required(pinhole_names[k]).as_quantity(k < 5 ? "px" : "1", range);
    values[k] = quantity.value;
    if (k == 0) fx_sigma = quantity.sigma.value_or(0.0);
  }
  return {values[0],
          values[1],
          values[2],
          values[3],
          values[4],
          {values[5], values[6], values[7]},
          {values[8], values[9]}};
}

/// A pinhole camera with the plane of its file, or one straight below it.
CameraModel read_pinhole_camera(const config::Node& root, double distance) {
  double fx_sigma = 0.0;
  PinholeView view;
  view.camera = read_pinhole(root.required("pinhole"), fx_sigma);
  CameraModel model;
  if (root.has("plane")) {
    const config::Node plane = root["plane"];
    view.distance = plane.required("distance").as_quantity("m", Range{1e-6, 1e3}).value;
    const auto normal = compensation::exactly(plane.required("normal"), 3, "1");
    view.normal = Eigen::Vector3d{normal[0], normal[1], normal[2]};
    if (!(view.normal.z() > 0.1 * view.normal.norm()))
      plane["normal"].fault("does not point away from the camera", "calibrate with --plane again");
    view.normal.normalize();
    model.scale_sigma = plane.required("scale_sigma").as_quantity("m/px", Range::not_negative()).value;
  } else if (!(distance > 0.0)) {
    root["model"].fault(
        "the plane that this camera looks at is not known",
        "calibrate with --plane VIEW, the view of the target on the substrate, or give the distance");
    view.distance = 1.0;
  }
  if (distance > 0.0) {
    view.distance = distance;
    view.normal = Eigen::Vector3d::UnitZ();
    model.scale_sigma = distance * fx_sigma / (view.camera.fx * view.camera.fx);
  }
  model.scale = view.scale();
  model.center = {view.camera.u0, view.camera.v0};
  model.pinhole = view;
  return model;
}

}  // namespace

CameraModel read_camera(const std::filesystem::path& file, double distance) {
  const auto yaml = config::Yaml::load(file);
  compensation::check_seal(yaml);
  const config::Node root = yaml.root();
  if (root.has("invar_camera")) (void)root.integer("invar_camera", 1, 1);
  const std::string model = root.has("model") ? root["model"].as_text() : "scale";
  if (root.has("note")) root["note"].accept_all();
  if (model == "pinhole") {
    CameraModel camera = read_pinhole_camera(root, distance);
    yaml.finish();
    return camera;
  }
  if (model != "scale") root["model"].fault("is no model of a camera", "scale and pinhole are known");
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

std::string camera_yaml(const metrology::PinholeCamera& camera, const metrology::PinholeCamera& sigma,
                        const std::string& lens, const std::optional<CameraPlane>& plane) {
  std::string text = "invar_camera: 1\nmodel: pinhole  # lens " + lens + "\npinhole:\n";
  const auto values = numbers_of(camera), sigmas = numbers_of(sigma);
  for (std::size_t k = 0; k < values.size(); ++k)
    if (values[k] != 0.0 || sigmas[k] > 0.0)  // what was not fitted is not there
      text += "  " + std::string{pinhole_names[k]} + ": {value: " + digits(values[k]) +
              ", unit: " + (k < 5 ? "px" : "\"1\"") + ", sigma: " + digits(sigmas[k]) + "}\n";
  if (plane) {
    const auto& normal = plane->view.normal;
    text +=
        "plane:  # normal . point = normal . (0, 0, distance) in the camera's frame\n  distance: {value: " +
        digits(plane->view.distance) + ", unit: m}\n  normal: [" + digits(normal.x()) + ", " +
        digits(normal.y()) + ", " + digits(normal.z()) +
        "]\n  scale_sigma: {value: " + digits(plane->scale_sigma) + ", unit: m/px}\n";
  }
  return text + "checksum: \"" + compensation::checksum(text) + "\"\n";
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
