// Camera scale from a picture of circles of known radius.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/vision/camera.hpp"
#include "core/vision/outline.hpp"

namespace cv {
class Mat;
}  // namespace cv

namespace invar::vision {

struct RulerCircle {
  Shape outline;          // px, as seen
  double radius = 0.0;    // m, known
  double residual = 0.0;  // px, measured minus modelled mean radius
  double sigma = 0.0;     // px, standard deviation of the mean radius
};

struct RulerFit {
  CameraModel camera;
  bool distortion_identified = false;
  bool aspect_identified = false;
  bool offset_identified = false;
  double offset = 0.0;  // px by which every outline lies outside its circle: exposure or print spreads it
  double offset_sigma = 0.0;         // px
  double residual = 0.0;             // px, RMS of the edges about the modelled circles
  std::vector<RulerCircle> circles;  // in the order of the radii that were given
};

/// Findings where the picture does not show the circles of the ruler.
struct RulerFailure {
  std::string what;
};

/// `radii`: of every circle [m], any order of size. Circles are matched by their size. All edges are fitted at once. Free
/// together are scale, radial distortion about the middle of the image, aspect, an offset common to all outlines, and every
/// circle's centre. Each of the three effects stays in only where it is beyond 3.5 standard deviations.
/// `image`: CV_8UC1.
std::optional<RulerFit> calibrate_ruler(const cv::Mat& image, const std::vector<double>& radii,
                                        RulerFailure& failure);

}  // namespace invar::vision
