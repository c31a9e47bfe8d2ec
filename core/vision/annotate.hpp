// Draws what was measured into the image, for reports and for people at the cell.
#pragma once

#include <string>
#include <vector>

#include "core/vision/droplets.hpp"

namespace cv {
class Mat;
}  // namespace cv

namespace invar::vision {

enum class Colour { green, amber, red, blue };

struct AnnotatedOutline {
  Shape outline;
  Colour colour = Colour::green;
  std::string label;  // ASCII; empty: none
};

struct AnnotatedTarget {
  double x = 0.0, y = 0.0;        // px; where a drop should be
  double to_x = 0.0, to_y = 0.0;  // px; where it is: an arrow is drawn to there
  double exaggeration = 1.0;      // of the arrow
};

/// BGR image of the same size. Outlines are drawn to 1/16 px. `image`: CV_8UC1.
cv::Mat annotate(const cv::Mat& image, const std::vector<AnnotatedOutline>& outlines,
                 const std::vector<AnnotatedTarget>& targets = {});

/// Sound drops green, cut ones amber, satellites blue, dust red.
cv::Mat annotate(const cv::Mat& image, const Droplets& droplets,
                 const std::vector<AnnotatedTarget>& targets = {});

/// Turns each target's arrow to the nearest sound drop within `reach` px; a target without one keeps none.
void point_at_nearest(std::vector<AnnotatedTarget>& targets, const Droplets& droplets, double reach);

/// The bytes of a PNG file.
std::vector<unsigned char> encode_png(const cv::Mat& image);

}  // namespace invar::vision
