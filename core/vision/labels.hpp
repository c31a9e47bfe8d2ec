// Which pixels of an image hang together.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace invar::vision {

/// One bit a pixel, rows in words of 64; bits beyond the last column are 0.
class BitMask {
 public:
  BitMask() = default;
  BitMask(int rows, int columns)
      : rows_{rows}, words_{(columns + 63) / 64}, bits_(static_cast<std::size_t>(rows_ * words_)) {}
  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] int words() const { return words_; }  // of a row
  [[nodiscard]] std::uint64_t* row(int y) { return bits_.data() + y * words_; }
  [[nodiscard]] const std::uint64_t* row(int y) const { return bits_.data() + y * words_; }

 private:
  int rows_ = 0, words_ = 0;
  std::vector<std::uint64_t> bits_;
};

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
Blobs label_blobs(const BitMask& mask, double smallest);

/// One blob alone: 255 where it is, 0 elsewhere in its box and in a margin of 1 px around it.
cv::Mat1b mask_of(const Blobs& blobs, const Blob& blob);

}  // namespace invar::vision
