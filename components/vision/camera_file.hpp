// camera.yaml: a camera's scale and lens, written by `calibrate camera`, read by whatever turns pixels into metres.
#pragma once

#include <filesystem>
#include <string>

#include "components/vision/camera.hpp"

namespace invar::vision {

/// Throws InputError for what is missing or wrong, and where the file's checksum does not fit its text. Only `scale` is
/// required.
CameraModel read_camera(const std::filesystem::path& file);

/// The text of a camera.yaml; its last line is a checksum of those above it.
std::string camera_yaml(const CameraModel& camera);

}  // namespace invar::vision
