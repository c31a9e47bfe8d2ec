// Renders drops on a substrate as a camera sees them, with known truth: the cell's simulated camera and the tests' scenes.
#pragma once

#include <opencv2/core/mat.hpp>

#include "core/vision/scene.hpp"

namespace invar::vision {

/// 8-bit grey image. Same scene, same image, bit for bit.
cv::Mat render(const Scene& scene);

/// Where a point of the ideal image is seen in the distorted one [px].
cv::Point2d seen_at(const Scene& scene, double x, double y);

}  // namespace invar::vision
