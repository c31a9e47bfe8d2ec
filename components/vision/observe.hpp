// One camera frame in, droplets in metres out: what the vision component does with each frame.
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "components/vision/camera.hpp"
#include "components/vision/droplets.hpp"

namespace invar::vision {

struct ObservedDroplet {
  double x = 0.0,
         y = 0.0;         // m, in the camera's frame: x right, y down, from the centre of the top left pixel
  double diameter = 0.0;  // m, of the circle of equal area
  double sigma = 0.0;     // m, standard deviation of x and of y, from the image alone
  double score = 0.0;     // 0..1
};

struct Observation {
  Droplets droplets;                      // as measured, in px, satellites and cut ones marked
  std::vector<ObservedDroplet> observed;  // the sound ones, in the same order, best first
};

/// Any image that OpenCV holds (see gray()). Allocates; takes 2 to 5 ms for 1200 x 800 on one thread: for a worker,
/// never for the loop.
Observation observe(const cv::Mat& frame, const CameraModel& camera);

/// The frame with outlines by status, and for each target the arrow from it to the nearest sound droplet within `reach`
/// px, `exaggeration` times enlarged. Targets in metres of the camera's frame. BGR.
cv::Mat annotate(const cv::Mat& frame, const Observation& observation, const CameraModel& camera,
                 const std::vector<Eigen::Vector2d>& targets, double reach, double exaggeration = 1.0);

}  // namespace invar::vision
