#include "core/vision/ray_samples.hpp"

#include <cmath>
#include <cstring>

#include "core/base/contract.hpp"
#include "core/vision/wide_vectors.hpp"

namespace invar::vision {

namespace {

using Numbers [[gnu::vector_size(lanes * sizeof(std::int32_t))]] = std::int32_t;
using Pairs [[gnu::vector_size(lanes * sizeof(std::uint16_t))]] = std::uint16_t;

// Whole numbers to the end: every CPU gets the same digits.
INVAR_WIDE_VECTORS
void read_rays(const std::uint8_t* data, std::int32_t stride, const EightRays& rays, std::size_t count,
               Lanes* out) {
  Numbers u, v, step_u, step_v;
  std::memcpy(&u, rays.u.data(), sizeof u);
  std::memcpy(&v, rays.v.data(), sizeof v);
  std::memcpy(&step_u, rays.step_u.data(), sizeof step_u);
  std::memcpy(&step_v, rays.step_v.data(), sizeof step_v);
  const auto pair_at = [](const std::uint8_t* from) {
    std::uint16_t pair = 0;
    std::memcpy(&pair, from, sizeof pair);
    return pair;
  };
  for (std::size_t j = 0; j < count; ++j) {
    const Numbers at = (v >> 16) * stride + (u >> 16);
    std::array<std::int32_t, lanes> place;
    std::memcpy(place.data(), &at, sizeof at);
    const auto pairs_of = [&](const std::uint8_t* row, Pairs& pairs) {
      pairs = Pairs{pair_at(row + place[0]), pair_at(row + place[1]), pair_at(row + place[2]),
                    pair_at(row + place[3]), pair_at(row + place[4]), pair_at(row + place[5]),
                    pair_at(row + place[6]), pair_at(row + place[7])};
    };
    Pairs upper_pair, lower_pair;
    pairs_of(data, upper_pair);
    pairs_of(data + stride, lower_pair);
    const Numbers up = __builtin_convertvector(upper_pair, Numbers),
                  low = __builtin_convertvector(lower_pair, Numbers);
    const Numbers a = (u >> 8) & 255, b = (v >> 8) & 255;
    const Numbers up_left = up & 255, low_left = low & 255;
    const Numbers upper = up_left * 256 + ((up >> 8) - up_left) * a,
                  lower = low_left * 256 + ((low >> 8) - low_left) * a;
    const Numbers between = upper * 256 + (lower - upper) * b;
    out[j] = __builtin_convertvector(between, Lanes) * (1.0F / 65536.0F) - 128.0F;
    u += step_u;
    v += step_v;
  }
}

}  // namespace

RaySamples::RaySamples(const cv::Mat& image)
    : data_{image.ptr<std::uint8_t>()},
      stride_{static_cast<std::int32_t>(image.step)},
      right_{image.cols - 1.01},
      bottom_{image.rows - 1.01} {
  INVAR_EXPECTS(image.type() == CV_8UC1 && image.cols < 32768 && image.rows < 32768, image.type(), image.cols,
                image.rows);
}

void RaySamples::read(const EightRays& rays, std::size_t count, Lanes* out) const {
  read_rays(data_, stride_, rays, count, out);
}

// Every ray has a lane of its own, so that each CPU gets the same digits however wide its vectors are.
INVAR_WIDE_VECTORS
void take_products(const Lanes* samples, const EdgeFilter& filter, RayProducts& products) {
  const auto length = static_cast<std::size_t>(2 * filter.half + 1);
  std::array<Lanes, EdgeFilter::rows> sums{};
  Lanes square{};
  for (std::size_t j = 0; j < length; ++j) {
    const Lanes value = samples[j];
#pragma GCC unroll 16
    for (std::size_t row = 0; row < EdgeFilter::rows; ++row) sums[row] += filter.products[row][j] * value;
    square += value * value;
  }
  products = {sums, square};
}

INVAR_WIDE_VECTORS
void place_edges(const RayProducts& products, const EdgeFilter& filter, const EdgeRule& rule,
                 const float* cosine, const float* sine, RayEdges& edges) {
  Lanes c, s;
  std::memcpy(&c, cosine, sizeof c);
  std::memcpy(&s, sine, sizeof s);
  const Lanes in = rule.inside[0] + rule.inside[1] * c + rule.inside[2] * s;
  const Lanes out = rule.outside[0] + rule.outside[1] * c + rule.outside[2] * s;
  const auto level = [&](EdgeFilter::Row row, Eigen::Index k, Lanes& to) {
    to = products.rows[row] - static_cast<float>(filter.from_inner(k)) * in -
         static_cast<float>(filter.from_outer(k)) * out;
  };
  std::array<Lanes, 3> levels;  // ground, contrast, contrast * offset
  level(EdgeFilter::to_ground, 0, levels[0]);
  level(EdgeFilter::to_height, 1, levels[1]);
  level(EdgeFilter::to_shift, 2, levels[2]);
  const Lanes height = levels[1] * rule.polarity;
  const auto sound = (height >= rule.least) & (height <= rule.most);
  edges.sound = sound ? Lanes{} + 1.0F : Lanes{};
  const Lanes offset = levels[2] / (sound ? levels[1] : Lanes{} + 1.0F);
  edges.offset =
      offset < -rule.reach ? Lanes{} - rule.reach : (offset > rule.reach ? Lanes{} + rule.reach : offset);
  Lanes square = products.square;
  square -= 2.0F * (in * products.rows[EdgeFilter::to_inner] + out * products.rows[EdgeFilter::to_outer]);
  square += in * in * static_cast<float>(filter.inner_inner) +
            2.0F * in * out * static_cast<float>(filter.inner_outer) +
            out * out * static_cast<float>(filter.outer_outer);
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b)
      square -=
          levels[a] * levels[b] *
          static_cast<float>(filter.columns(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)));
  for (std::size_t lane = 0; lane < lanes; ++lane)
    edges.misfit[lane] = std::sqrt(std::max(0.0F, square[lane]));
}

INVAR_WIDE_VECTORS
void find_steps(const Lanes* samples, std::size_t length, float polarity, float expected, float reach,
                Lanes* slope, std::array<std::int32_t, lanes>& at) {
  Lanes best{};
  Numbers place = Numbers{} - 1;
  for (std::size_t j = 2; j + 2 < length; ++j) {
    const float away = (static_cast<float>(j) - expected) / (reach + 1.0F);
    slope[j] = 0.5F * polarity * (samples[j - 2] + samples[j - 1] - samples[j + 1] - samples[j + 2]);
    const Lanes value = slope[j] * (1.0F - 0.3F * away * away);
    const auto better = value > best;
    best = better ? value : best;
    place = better ? Numbers{} + static_cast<std::int32_t>(j) : place;
  }
  std::memcpy(at.data(), &place, sizeof place);
}

}  // namespace invar::vision
