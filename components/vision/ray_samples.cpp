#include "components/vision/ray_samples.hpp"

#include <array>
#include <cstring>

#include "components/vision/wide_vectors.hpp"
#include "core/base/contract.hpp"

namespace invar::vision {

namespace {

constexpr std::size_t lanes = EdgeFilter::lanes;
using Lanes [[gnu::vector_size(lanes * sizeof(float))]] = float;
using Numbers [[gnu::vector_size(lanes * sizeof(std::int32_t))]] = std::int32_t;
using Pairs [[gnu::vector_size(lanes * sizeof(std::uint16_t))]] = std::uint16_t;

struct Ray {
  const std::uint8_t* data;
  std::int32_t stride;
  std::int32_t u, v, step_u, step_v;  // 1/65536 px
};

// Whole numbers to the end: every CPU gets the same digits.
INVAR_WIDE_VECTORS
void read_ray(const Ray& ray, std::size_t count, float* out) {
  constexpr Numbers ramp{0, 1, 2, 3, 4, 5, 6, 7};
  Numbers u = ray.u + ramp * ray.step_u, v = ray.v + ramp * ray.step_v;
  const std::int32_t first = (ray.v >> 16) * ray.stride + (ray.u >> 16);
  const auto pair_at = [](const std::uint8_t* from) {
    std::uint16_t pair = 0;
    std::memcpy(&pair, from, sizeof pair);
    return pair;
  };
  for (std::size_t j = 0; j < count; j += lanes) {
    // Beyond the last sample the first is read once more, and counts nothing.
    const Numbers inside = ramp < static_cast<std::int32_t>(count - j);
    const Numbers at = (((v >> 16) * ray.stride + (u >> 16)) & inside) | (first & ~inside);
    std::array<std::int32_t, lanes> place;
    std::memcpy(place.data(), &at, sizeof at);
    const std::uint8_t *upper_row = ray.data, *lower_row = ray.data + ray.stride;
    const auto pairs_of = [&](const std::uint8_t* row, Pairs& pairs) {
      pairs = Pairs{pair_at(row + place[0]), pair_at(row + place[1]), pair_at(row + place[2]),
                    pair_at(row + place[3]), pair_at(row + place[4]), pair_at(row + place[5]),
                    pair_at(row + place[6]), pair_at(row + place[7])};
    };
    Pairs upper_pair, lower_pair;
    pairs_of(upper_row, upper_pair);
    pairs_of(lower_row, lower_pair);
    const Numbers up = __builtin_convertvector(upper_pair, Numbers),
                  low = __builtin_convertvector(lower_pair, Numbers);
    const Numbers a = (u >> 8) & 255, b = (v >> 8) & 255;
    const Numbers up_left = up & 255, low_left = low & 255;
    const Numbers upper = up_left * 256 + ((up >> 8) - up_left) * a,
                  lower = low_left * 256 + ((low >> 8) - low_left) * a;
    const Numbers between = (upper * 256 + (lower - upper) * b) & inside;
    const Lanes value = __builtin_convertvector(between, Lanes) * (1.0F / 65536.0F);
    std::memcpy(out + j, &value, sizeof value);
    u += ray.step_u * static_cast<std::int32_t>(lanes);
    v += ray.step_v * static_cast<std::int32_t>(lanes);
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

void RaySamples::read(double x, double y, double dx, double dy, std::size_t count, float* out) const {
  constexpr double unit = 65536.0;
  const auto whole = [](double value) { return static_cast<std::int32_t>(value * unit + 0.5); };
  // Steps may be negative: rounded down as a number above zero would be.
  read_ray({data_, stride_, whole(x), whole(y), whole(dx + 4.0) - whole(4.0), whole(dy + 4.0) - whole(4.0)},
           count, out);
}

// Sums run in lanes of their own, so that every CPU gets the same digits however wide its vectors are.
INVAR_WIDE_VECTORS
RayProducts take_products(const std::array<float, EdgeFilter::padded>& f, const EdgeFilter& filter,
                          std::size_t length, const std::array<float, 3>& harmonic,
                          std::array<std::array<float, EdgeFilter::padded>, 3>& sums) {
  Lanes ground{}, height{}, shift{}, inner{}, outer{}, square{};
  const Lanes level = Lanes{} + harmonic[0], cosine = Lanes{} + harmonic[1], sine = Lanes{} + harmonic[2];
  Lanes value, other;
  const auto add = [&](Lanes& sum, EdgeFilter::Row row, std::size_t j) {
    std::memcpy(&other, &filter.products[row][j], sizeof other);
    sum += other * value;
  };
  const auto add_to = [&](float* to, const Lanes& weight) {
    std::memcpy(&other, to, sizeof other);
    other += weight * value;
    std::memcpy(to, &other, sizeof other);
  };
  for (std::size_t j = 0; j < length; j += lanes) {
    std::memcpy(&value, &f[j], sizeof value);
    add(ground, EdgeFilter::to_ground, j);
    add(height, EdgeFilter::to_height, j);
    add(shift, EdgeFilter::to_shift, j);
    add(inner, EdgeFilter::to_inner, j);
    add(outer, EdgeFilter::to_outer, j);
    square += value * value;
    add_to(&sums[0][j], level);
    add_to(&sums[1][j], cosine);
    add_to(&sums[2][j], sine);
  }
  const auto total = [](const Lanes& part) {
    return static_cast<double>(((part[0] + part[4]) + (part[1] + part[5])) +
                               ((part[2] + part[6]) + (part[3] + part[7])));
  };
  return {{total(ground), total(height), total(shift), total(inner), total(outer)}, total(square)};
}

}  // namespace invar::vision
