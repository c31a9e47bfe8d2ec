// Divides a reduced image into thing and ground by a threshold that follows the light.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace invar::vision {

/// The image's two classes in local averages, in tiles of 16 px.
struct Partition {
  cv::Mat1b light;  // 255 where a pixel belongs to the lighter class as a thing would (see polarity), else 0
  cv::Mat1b dark;   // 255 where it belongs to the darker class as a thing would
  double light_contrast =
      0.0;  // grey levels, median over the image of light things minus their surroundings; 0: none
  double dark_contrast = 0.0;  // grey levels, of surroundings minus dark things
  double noise = 0.0;          // grey levels of this image, standard deviation from pixel to pixel
};

/// `image`: CV_8UC1, small. `window`: tiles each way within which the light is taken as even. `polarity`: +1 only light things
/// are wanted, -1 only dark ones, 0 both; the other mask stays empty.
Partition partition(const cv::Mat1b& image, int window, int polarity);

/// A connected set of pixels (8-neighbours) of one image.
struct Blob {
  int label = 0;
  double area = 0.0;        // px^2
  double x = 0.0, y = 0.0;  // centroid, px
  double roundness = 0.0;   // area^2 / (2 pi (mu20 + mu02)): 1 for a full disc, less for everything else
  int left = 0, top = 0, right = 0, bottom = 0;  // px, all inclusive
};

/// Pixels of one row that hang together.
struct BlobRun {
  int y, begin, end;  // px; end is exclusive
  int label;          // of its blob + 1; 0: of one that was left out
};

struct Blobs {
  std::vector<Blob> blobs;
  std::vector<BlobRun> runs;  // by rows
};

/// Blobs of a mask by runs and union-find. Those below `smallest` px are left out.
Blobs label_blobs(const cv::Mat1b& mask, double smallest);

/// One blob alone: 255 where it is, 0 elsewhere in its box and in a margin of 1 px around it.
cv::Mat1b mask_of(const Blobs& blobs, const Blob& blob);

}  // namespace invar::vision
