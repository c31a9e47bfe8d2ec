// From plain pixels to OpenCV's images and back.
#pragma once

#include <opencv2/core/mat.hpp>

#include "core/vision/pixels.hpp"

namespace invar::vision {

/// Refers to the same bytes; nothing may write there.
cv::Mat mat_of(const PixelsView& picture);

/// A copy. `image`: CV_8UC1 or CV_16UC1.
Pixels pixels_of(const cv::Mat& image);

}  // namespace invar::vision
