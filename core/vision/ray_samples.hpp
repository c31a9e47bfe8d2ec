// Samples of the image along rays, eight of them side by side, and their products with an edge filter: the inner loops of
// every outline.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "core/vision/edge_filter.hpp"

namespace invar::vision {

constexpr std::size_t lanes = 8;  // rays that are read at once
using Lanes [[gnu::vector_size(lanes * sizeof(float))]] = float;

inline double sum_of(const Lanes& v) {
  return static_cast<double>(((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7])));
}

/// Where eight rays begin and how they step from sample to sample, in 1/65536 px. One that is left out reads the first
/// pixel.
struct EightRays {
  static constexpr double unit = 65536.0;
  std::array<std::int32_t, lanes> u{}, v{}, step_u{}, step_v{};
};

/// Reads an image between its pixels, bilinearly.
class RaySamples {
 public:
  /// `image`: CV_8UC1, which must live as long.
  explicit RaySamples(const cv::Mat& image);
  [[nodiscard]] bool holds(double x, double y) const { return holds(x, y, 0.0); }
  /// The whole square of this half side.
  [[nodiscard]] bool holds(double x, double y, double half) const {
    return x >= half && y >= half && x + half <= right_ && y + half <= bottom_;
  }
  /// `count` samples a pixel apart along each ray, all of which the image holds, less 128: so that squares stay small.
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

/// Properties common to the rays of a drop, and the edge of each.
struct EdgeRule {
  std::array<float, 3> inside, outside;  // slopes [1/px]: constant, cosine, sine
  float polarity, least, most;           // what the height of a sound edge lies between, times polarity
  float reach;                           // px
};
struct RayEdges {
  Lanes offset, misfit, sound;  // px; grey levels; 1 where the height is that of an edge, else 0
};

/// Least squares is linear: what the slopes give is taken off the products instead of off every sample. `cosine`, `sine`: of
/// the eight rays.
void place_edges(const RayProducts& products, const EdgeFilter& filter, const EdgeRule& rule,
                 const float* cosine, const float* sine, RayEdges& edges);

/// The steepest step of the right sign (`polarity`) among samples 2 .. length - 3 of eight rays; steps away from `expected`
/// weigh less. Gives `slope` of each sample, over two samples each side, and the place of the steepest, -1 where there is none.
void find_steps(const Lanes* samples, std::size_t length, float polarity, float expected, float reach,
                Lanes* slope, std::array<std::int32_t, lanes>& at);

void take_products(const Lanes* samples, const EdgeFilter& filter, RayProducts& products);
}  // namespace invar::vision
