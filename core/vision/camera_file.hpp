// camera.yaml: a camera's scale and lens, written by `calibrate camera`, read by whatever turns pixels into metres.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/vision/camera.hpp"

namespace invar::vision {

/// Throws InputError for a missing or wrong key, and where the file's checksum does not fit its text. A file of model `scale` needs
/// `scale` alone. A pinhole camera needs the plane that it looks at: its file's, or one straight below it at `distance`
/// [m] (0: none is given).
CameraModel read_camera(const std::filesystem::path& file, double distance = 0.0);

/// The plane that a pinhole camera looks at, and how well the scale there is known.
struct CameraPlane {
  PinholeView view;
  double scale_sigma = 0.0;  // m/px
};
/// The text of a pinhole camera.yaml, with standard deviations; `lens` names its terms; `plane` where it is known.
std::string camera_yaml(const metrology::PinholeCamera& camera, const metrology::PinholeCamera& sigma,
                        const std::string& lens, const std::optional<CameraPlane>& plane);

/// The text of a camera.yaml; its last line is a checksum of those above it.
std::string camera_yaml(const CameraModel& camera);

}  // namespace invar::vision
