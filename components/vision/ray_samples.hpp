// What the image shows along rays, eight of them side by side, and their products with an edge filter: the inner loops of
// every outline.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "components/vision/edge_filter.hpp"

namespace invar::vision {

constexpr std::size_t lanes = 8;  // rays that are read at once
using Lanes [[gnu::vector_size(lanes * sizeof(float))]] = float;

/// Where eight rays begin and how they step from sample to sample, in 1/65536 px. One that is left out reads the first
/// pixel.
struct EightRays {
  std::array<std::int32_t, lanes> u{}, v{}, step_u{}, step_v{};
  void set(std::size_t lane, double x, double y, double dx, double dy);
};

/// Reads an image between its pixels, bilinearly.
class RaySamples {
 public:
  /// `image`: CV_8UC1, which must live as long.
  explicit RaySamples(const cv::Mat& image);
  [[nodiscard]] bool holds(double x, double y) const {
    return x >= 0.0 && y >= 0.0 && x <= right_ && y <= bottom_;
  }
  /// `count` samples a pixel apart along each ray, all of which the image holds.
  void read(const EightRays& rays, std::size_t count, Lanes* out) const;

 private:
  const std::uint8_t* data_;
  std::int32_t stride_;
  double right_, bottom_;  // the last coordinates that bilinear reading allows
};

/// The products of eight rays' samples with the rows of a filter, and the sums of their squares.
struct RayProducts {
  std::array<Lanes, EdgeFilter::rows> rows;
  Lanes square;
};

/// Sums over rays of what they show at each sample, by three weights a ray (1, cosine, sine of its angle).
using HarmonicSums = std::array<std::array<Lanes, EdgeFilter::most>, 3>;

/// Also adds the samples to `sums`, by the weights of `harmonic`.
void take_products(const Lanes* samples, const EdgeFilter& filter, const std::array<Lanes, 3>& harmonic,
                   RayProducts& products, HarmonicSums& sums);

}  // namespace invar::vision
