// What the image shows along a ray, and its products with an edge filter: the inner loop of every outline.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "components/vision/edge_filter.hpp"

namespace invar::vision {

/// Reads an image between its pixels, bilinearly. Positions along a ray count in 1/65536 px.
class RaySamples {
 public:
  /// `image`: CV_8UC1, which must live as long.
  explicit RaySamples(const cv::Mat& image);
  [[nodiscard]] bool holds(double x, double y) const {
    return x >= 0.0 && y >= 0.0 && x <= right_ && y <= bottom_;
  }
  /// `count` samples a pixel apart from (x, y) in direction (dx, dy), all of which the image holds; `out` is filled up
  /// with zeros to a multiple of eight.
  void read(double x, double y, double dx, double dy, std::size_t count, float* out) const;

 private:
  const std::uint8_t* data_;
  std::int32_t stride_;
  double right_, bottom_;  // the last coordinates that bilinear reading allows
};

/// The products of one ray's samples with the rows of a filter, and the sum of their squares.
struct RayProducts {
  std::array<double, EdgeFilter::rows> rows;
  double square;
};

/// Also adds the samples to `sums`, by the weights of `harmonic`. `f` is zero beyond `length`.
RayProducts take_products(const std::array<float, EdgeFilter::padded>& f, const EdgeFilter& filter,
                          std::size_t length, const std::array<float, 3>& harmonic,
                          std::array<std::array<float, EdgeFilter::padded>, 3>& sums);

}  // namespace invar::vision
