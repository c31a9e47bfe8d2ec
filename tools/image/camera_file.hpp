// camera.yaml: a camera's scale and lens, written by `calibrate camera`, read by whatever turns pixels into metres.
#pragma once

#include <filesystem>
#include <string>

#include "components/vision/camera.hpp"

namespace invar::tools {

/// Throws InputError for what is missing or wrong. Only `scale` is required.
vision::CameraModel read_camera(const std::filesystem::path& file);

/// The text of a camera.yaml. `width`, `height` of the image [px].
std::string camera_yaml(const vision::CameraModel& camera, int width, int height);

}  // namespace invar::tools
