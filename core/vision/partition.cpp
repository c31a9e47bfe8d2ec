#include "core/vision/partition.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core/hal/intrin.hpp>
#include <vector>

#include "core/vision/tiles.hpp"
#include "core/vision/wide_vectors.hpp"

namespace invar::vision {

namespace {

constexpr int first_row = 2, next_row = 4;  // of a tile: a quarter of its rows is enough for means

// Of what goes into a histogram a few thousand pixels are enough.
int histogram_step(const cv::Mat1b& image) { return next_row * std::max(1, image.rows / 160); }

double median(std::vector<float>& values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

// 1 where `larger` lies above `smaller`.
void classify(const std::uint8_t* larger, const std::uint8_t* smaller, int width, std::uint64_t* bits) {
  constexpr int lanes = cv::v_uint8x16::nlanes;
  for (int x = 0; x < width; x += 64) {
    std::uint64_t word = 0;
    int k = 0;
    for (const int end = std::min(64, width - x); k < end; k += lanes) {
      if (k + lanes > end) break;
      const auto above = cv::v_load(larger + x + k) > cv::v_load(smaller + x + k);
      word |= static_cast<std::uint64_t>(static_cast<unsigned>(cv::v_signmask(above))) << k;
    }
    for (; k < std::min(64, width - x); ++k)
      word |= static_cast<std::uint64_t>(larger[x + k] > smaller[x + k] ? 1U : 0U) << k;
    *bits++ = word;
  }
}

// How many of the values are at least `limit`.
INVAR_WIDE_VECTORS
int count_from(const std::vector<std::uint8_t>& values, std::uint8_t limit) {
  constexpr std::size_t part = 255;  // what a byte can count
  int count = 0;
  for (std::size_t begin = 0; begin < values.size();) {
    // Sixteen or more lanes of a byte each, added up before one of them is full.
    const std::size_t end = std::min(values.size(), begin + part);
    std::uint8_t few = 0;
    for (std::size_t i = begin; i < end; ++i)
      few = static_cast<std::uint8_t>(few + (values[i] >= limit ? 1 : 0));
    count += few;
    begin = end;
  }
  return count;
}

// The largest value that at least so many of the values reach.
int value_reached_by(const std::vector<std::uint8_t>& values, int so_many) {
  int least = 0, beyond = 256;
  while (beyond - least > 1) {
    const int middle = (least + beyond) / 2;
    (count_from(values, static_cast<std::uint8_t>(middle)) >= so_many ? least : beyond) = middle;
  }
  return least;
}

// |second difference| along a row, at most 255: blind to slopes.
INVAR_WIDE_VECTORS
void bend_of(const std::uint8_t* p, int count, std::uint8_t* out) {
  for (int x = 0; x < count; ++x) {
    const auto bend = static_cast<std::int16_t>(p[x] - 2 * p[x + 1] + p[x + 2]);
    const auto size = static_cast<std::int16_t>(bend < 0 ? -bend : bend);
    out[x] = static_cast<std::uint8_t>(size < 255 ? size : 255);
  }
}

INVAR_WIDE_VECTORS
void distance_of(const std::uint8_t* a, const std::uint8_t* b, int count, std::uint8_t* out) {
  for (int x = 0; x < count; ++x) out[x] = static_cast<std::uint8_t>(a[x] > b[x] ? a[x] - b[x] : b[x] - a[x]);
}

double noise_of(const cv::Mat1b& image) {
  std::vector<std::uint8_t> bends;
  const int step = 4 * histogram_step(image), width = image.cols - 2;
  bends.resize(static_cast<std::size_t>(width * (1 + (image.rows - 1 - first_row) / step)));
  std::uint8_t* out = bends.data();
  for (int y = first_row; y < image.rows; y += step, out += width)
    bend_of(image.ptr<std::uint8_t>(y), width, out);
  const auto count = static_cast<int>(bends.size());
  const int middle = value_reached_by(bends, (count + 1) / 2);
  const int from = count_from(bends, static_cast<std::uint8_t>(middle)),
            beyond = middle < 255 ? count_from(bends, static_cast<std::uint8_t>(middle + 1)) : 0;
  const double share = (from - 0.5 * count) / std::max(1, from - beyond);
  return std::max(0.0, middle - 0.5 + share) * 1.4826 / std::sqrt(6.0);
}

// The threshold between the things and the rest of each window, halfway between their levels; returns the median
// difference of the levels, signed. A window without a thing has its own mean and half the median difference.
double set_thresholds(const TileSums& things, const TileSums& things_n, const TileSums& whole,
                      const TileSums& whole_n, TileField& threshold) {
  constexpr float enough = 12.0F;  // px; fewer say nothing
  TileSums difference{things.columns(), things.rows()};
  std::vector<float> differences;
  differences.reserve(static_cast<std::size_t>(things.columns() * things.rows()));
  for (int j = 0; j < things.rows(); ++j)
    for (int i = 0; i < things.columns(); ++i) {
      const float n = things_n.at(i, j), rest = whole_n.at(i, j) - n;
      if (n < enough || rest < enough) continue;
      const float d = things.at(i, j) / n - (whole.at(i, j) - things.at(i, j)) / rest;
      if (d != 0.0F) differences.push_back(difference.at(i, j) = d);
    }
  if (differences.empty()) {
    for (int j = 0; j < things.rows(); ++j)
      for (int i = 0; i < things.columns(); ++i) threshold.at(i, j) = 1e9F;
    return 0.0;
  }
  // Windows that hold noise or shading alone have classes too, but they lie close together.
  const auto usual = static_cast<float>(median(differences));
  std::erase_if(differences, [&](float d) { return std::abs(d) < 0.5F * std::abs(usual); });
  const auto contrast = static_cast<float>(median(differences));
  for (int j = 0; j < things.rows(); ++j)
    for (int i = 0; i < things.columns(); ++i) {
      const float d = difference.at(i, j), n = things_n.at(i, j), rest = whole_n.at(i, j) - n;
      if (std::abs(d) > 0.35F * std::abs(contrast)) {
        threshold.at(i, j) = things.at(i, j) / n - 0.5F * d;
      } else if (rest < enough) {  // nothing but things
        threshold.at(i, j) = whole.at(i, j) / whole_n.at(i, j) - 0.5F * contrast;
      } else {
        threshold.at(i, j) = (whole.at(i, j) - things.at(i, j)) / rest + 0.5F * contrast;
      }
    }
  return static_cast<double>(contrast);
}

}  // namespace

Partition partition(const cv::Mat1b& image, int window, int polarity) {
  const int width = image.cols, height = image.rows;
  const int columns = (width + tile - 1) / tile, rows = (height + tile - 1) / tile;
  const bool want_light = polarity >= 0, want_dark = polarity <= 0;
  Partition out{{}, {}, 0.0, 0.0, noise_of(image)};
  if (want_light) out.light = BitMask{height, width};
  if (want_dark) out.dark = BitMask{height, width};
  const auto rows_of = [&](int j) {
    const int first = std::min(j * tile + first_row, height - 1), beyond = std::min(height, (j + 1) * tile);
    return TileRows{image.ptr<std::uint8_t>(first), next_row * image.step,
                    (beyond - first + next_row - 1) / next_row, width};
  };

  // What lies clearly above or below its surroundings' mean.
  TileSums sum{columns, rows}, count{columns, rows};
  for (int j = 0; j < rows; ++j) {
    sum_tiles(rows_of(j), sum.row(j));
    for (int i = 0; i < columns; ++i)
      count.at(i, j) = static_cast<float>(rows_of(j).count * std::min(tile, width - i * tile));
  }
  const TileSums whole = sum.windowed(window), whole_n = count.windowed(window);
  TileField mean{columns, rows};
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) mean.at(i, j) = whole.at(i, j) / whole_n.at(i, j);
  const int step = 2 * histogram_step(image);
  std::vector<std::uint8_t> distances(
      static_cast<std::size_t>(width * (1 + std::max(0, height - 1 - first_row) / step)));
  std::uint8_t* to = distances.data();
  for (int y = first_row; y < height; y += step, to += width)
    distance_of(image.ptr<std::uint8_t>(y), mean.row(y), width, to);
  const int extreme = value_reached_by(
      distances, std::max(1, static_cast<int>(0.001 * static_cast<double>(distances.size()))));
  const double margin = std::max(5.0 * out.noise + 1.0, 0.2 * extreme);
  if (extreme <= margin) return out;

  // Things against the rest: each class's local level, then the middle between the two; twice, since the second time
  // sees real classes. Then what lies beyond the threshold; nothing where that does not stand out from the noise.
  TileSums things{columns, rows}, things_n{columns, rows};
  const auto divide = [&](Beyond side, BitMask& mask) {
    TileField threshold{columns, rows};
    const auto away = static_cast<float>(side == Beyond::above ? margin : -margin);
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) threshold.at(i, j) = mean.at(i, j) + away;
    double contrast = 0.0;
    for (int pass = 0; pass < 2; ++pass) {
      for (int j = 0; j < rows; ++j)
        sum_beyond(rows_of(j), threshold.row(j * tile + tile / 2), side, things.row(j), things_n.row(j));
      contrast =
          set_thresholds(things.windowed(window), things_n.windowed(window), whole, whole_n, threshold);
    }
    if (side == Beyond::below) contrast = -contrast;
    if (contrast <= std::max(4.0 * out.noise, 2.0)) return 0.0;
    for (int y = 0; y < height; ++y) {
      const std::uint8_t* p = image.ptr<std::uint8_t>(y);
      const std::uint8_t* limit = y % 4 == 0 ? threshold.row(y + 2) : threshold.last();  // rows hardly differ
      classify(side == Beyond::above ? p : limit, side == Beyond::above ? limit : p, width, mask.row(y));
    }
    return contrast;
  };
  if (want_light) out.light_contrast = divide(Beyond::above, out.light);
  if (want_dark) out.dark_contrast = divide(Beyond::below, out.dark);
  return out;
}

}  // namespace invar::vision
