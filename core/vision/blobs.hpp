// Finds round things roughly, on a reduced image: light or dark, where the light is uneven, where they touch.
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

namespace invar::vision {

/// A circle to be measured, good to about a pixel or two of the reduced image. Pixels of the full image.
struct Candidate {
  double x = 0.0, y = 0.0, radius = 0.0;  // px
  bool alone = true;                      // its blob holds nothing else
};

struct Detection {
  int polarity = +1;  // +1 light things on dark ground, -1 dark things on light ground
  double contrast =
      0.0;  // grey levels between thing and ground, the median over the image; 0: nothing stands out
  double noise = 0.0;   // grey levels, standard deviation in the full image
  double radius = 0.0;  // px, typical: the area-weighted median
  std::vector<Candidate> candidates;
};

struct DetectionOptions {
  int polarity = 0;  // +1 light things, -1 dark ones; 0: found out
  int level =
      -1;  // the image is halved so many times first; -1: as often as leaves 3 px of the typical radius
  int window = 2;  // light is taken as even within this many tiles of 16 reduced px each way
};

/// The light is followed by local means of both classes (after Ridler and Calvard's iteration, in windows), so
/// that shading does not cost drops as a global threshold does. Blobs that are no discs are taken apart by the
/// directions of their outline, which point to the centres (Hough's idea, within one blob). `image`: CV_8UC1.
Detection detect(const cv::Mat& image, const DetectionOptions& options = {});

}  // namespace invar::vision
