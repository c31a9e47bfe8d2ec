// Droplets in an image: found, measured to a hundredth of a pixel, and told from satellites, dust and cut ones.
#pragma once

#include <limits>
#include <string_view>
#include <vector>

#include "core/vision/outline.hpp"

namespace cv {
class Mat;
}  // namespace cv

namespace invar::vision {

enum class DropletStatus { ok, satellite, cut, dust };
std::string_view name(DropletStatus status);

struct Droplet {
  double x = 0.0,
         y = 0.0;       // px of the image as it is; x right, y down, (0, 0) the centre of the top left pixel
  double radius = 0.0;  // px, of the circle of equal area
  double circularity = 0.0;  // 4 pi area / perimeter^2 of the outline: 1 for a circle
  double score = 0.0;        // 0..1; how much of the outline was seen and how well it agrees
  DropletStatus status = DropletStatus::ok;
  double sigma = 0.0;  // px, standard deviation of x and of y
  Shape outline;       // the closed curve that was fitted, corrected for blur
};

struct Droplets {
  std::vector<Droplet> droplets;  // sound ones first, then by score, best first
  int polarity = +1;              // +1 light drops on dark ground
  double contrast = 0.0;          // grey levels; 0: nothing stands out from the ground
  double blur = 0.0;              // px
  double radius = 0.0;            // px, median of the sound ones

  [[nodiscard]] std::size_t sound() const;
};

/// 8-bit grey from any image that OpenCV reads: colour by its luminance, 16 bits scaled to the image's range.
cv::Mat gray(const cv::Mat& image);

/// Facts known beforehand; all of them are found out otherwise.
struct MeasureOptions {
  int polarity = 0;           // +1 light drops, -1 dark ones; 0: not known
  double least_radius = 0.0;  // px; smaller drops are satellites, also below 0.55 of the typical radius
  double largest_radius = std::numeric_limits<double>::infinity();  // px; larger things are dust
};

/// Light drops on dark ground or dark on light. Satellites are what is smaller than 0.55 of the typical radius; a drop of
/// which a tenth of the radius or more lies outside the image is cut. Cost: about that of reading the image ten times.
/// Any thread; allocates.
Droplets measure_droplets(const cv::Mat& image, const MeasureOptions& options = {});

}  // namespace invar::vision
