// `invar calibrate camera`: what its two forms (ruler of circles, views of a flat target) share.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

namespace invar::tools {

struct CameraOptions {
  std::optional<std::filesystem::path> image, ruler;  // a ruler of circles
  std::optional<std::filesystem::path> target;        // a flat target in several views
  std::vector<std::filesystem::path> views;
  std::filesystem::path out;
};

void calibrate_by_target(const CameraOptions& options);

}  // namespace invar::tools
