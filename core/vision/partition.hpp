// Divides a reduced image into thing and ground by a threshold that follows the light.
#pragma once

#include <opencv2/core/mat.hpp>

#include "core/vision/labels.hpp"

namespace invar::vision {

/// The image's two classes in local averages, in tiles of 16 px.
struct Partition {
  BitMask light;  // 1 where a pixel belongs to the lighter class as a thing would (see polarity), else 0
  BitMask dark;   // 1 where it belongs to the darker class as a thing would
  double light_contrast =
      0.0;  // grey levels, median over the image of light things minus their surroundings; 0: none
  double dark_contrast = 0.0;  // grey levels, of surroundings minus dark things
  double noise = 0.0;          // grey levels of this image, standard deviation from pixel to pixel
};

/// `image`: CV_8UC1, small. `window`: tiles each way within which the light is taken as even. `polarity`: +1 only light things
/// are wanted, -1 only dark ones, 0 both; the other mask stays empty.
Partition partition(const cv::Mat1b& image, int window, int polarity);

}  // namespace invar::vision
