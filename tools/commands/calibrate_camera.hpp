// `invar calibrate camera`: what its two forms (ruler of circles, views of a flat target) share.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tools/report/page.hpp"

namespace invar::tools {

struct CameraOptions {
  std::optional<std::filesystem::path> image, ruler;  // a ruler of circles
  std::optional<std::filesystem::path> target;        // a flat target in several views
  std::vector<std::filesystem::path> views;
  std::optional<std::filesystem::path> plane;  // the view of the target that lies on the substrate
  std::filesystem::path out;
};

void calibrate_by_target(const CameraOptions& options);

/// Makes the folder and writes report.html, report.json and camera.yaml. Throws InputError where that fails.
void write_camera_result(const std::filesystem::path& folder, const std::string& camera,
                         const std::string& json, const report::Page& page);

}  // namespace invar::tools
