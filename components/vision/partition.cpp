#include "components/vision/partition.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>

#include "components/vision/wide_vectors.hpp"

namespace invar::vision {

namespace {

constexpr int tile = 16;                    // px a side
constexpr int lanes = 8;                    // px that are interpolated at once
constexpr int first_row = 2, next_row = 4;  // of a tile: a quarter of its rows is enough for means

// Of what goes into a histogram a few thousand pixels are enough.
int histogram_step(const cv::Mat1b& image) { return next_row * std::max(1, image.rows / 160); }

// Sums over tiles, then over windows of tiles, by one table of running sums.
class TileSums {
 public:
  TileSums(int columns, int rows) : columns_{columns}, rows_{rows}, cells_(cells(columns, rows), 0.0F) {}
  float& at(int i, int j) { return cells_[static_cast<std::size_t>(j * columns_ + i)]; }
  [[nodiscard]] float at(int i, int j) const { return cells_[static_cast<std::size_t>(j * columns_ + i)]; }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] TileSums windowed(int reach) const {
    TileSums across{columns_, rows_}, both{columns_, rows_};
    smooth(cells_, across.cells_, columns_, rows_, 1, columns_, reach);
    smooth(across.cells_, both.cells_, rows_, columns_, columns_, 1, reach);
    return both;
  }

 private:
  static std::size_t cells(int columns, int rows) { return static_cast<std::size_t>(columns * rows); }
  static void smooth(const std::vector<float>& from, std::vector<float>& to, int length, int lines, int step,
                     int stride, int reach) {
    for (int line = 0; line < lines; ++line) {
      const auto index = [&](int k) { return static_cast<std::size_t>(line * stride + k * step); };
      float sum = 0.0F;
      for (int k = 0; k < std::min(reach, length); ++k) sum += from[index(k)];
      for (int k = 0; k < length; ++k) {
        if (k + reach < length) sum += from[index(k + reach)];
        if (k - reach - 1 >= 0) sum -= from[index(k - reach - 1)];
        to[index(k)] = sum;
      }
    }
  }
  int columns_, rows_;
  std::vector<float> cells_;
};

// From levels at the middles of the tiles to a row of pixels between them, rounded: 8 bits below the point, in 16.
void interpolate(const std::vector<float>& levels, std::vector<std::uint8_t>& row) {
  using Words [[gnu::vector_size(16)]] = std::uint16_t;
  using Bytes [[gnu::vector_size(8)]] = std::uint8_t;
  constexpr Words ramp{0, 1, 2, 3, 4, 5, 6, 7};
  const int columns = static_cast<int>(levels.size()), width = static_cast<int>(row.size());
  const auto level = [&](int i) { return levels[static_cast<std::size_t>(std::clamp(i, 0, columns - 1))]; };
  for (int i = -1; i < columns; ++i) {
    const float left = level(i);
    const int slope = static_cast<int>((level(i + 1) - left) * (256.0F / tile));
    const int start = static_cast<int>(left * 256.0F) + slope / 2 + 128, begin = i * tile + tile / 2;
    for (int part = 0; part < tile; part += lanes) {
      const Words words = (Words{} + static_cast<std::uint16_t>(start + part * slope) +
                           ramp * static_cast<std::uint16_t>(slope)) >>
                          8;
      const Bytes bytes = __builtin_convertvector(words, Bytes);
      const int at = begin + part, from = std::max(0, -at), to = std::min(lanes, width - at);
      if (to - from == lanes) {
        std::memcpy(row.data() + at, &bytes, sizeof bytes);
      } else {
        for (int k = from; k < to; ++k) row[static_cast<std::size_t>(at + k)] = bytes[k];
      }
    }
  }
}

// A value a tile, read between the tiles' centres by bilinear interpolation, row by row.
class TileField {
 public:
  TileField(int columns, int rows, int width)
      : columns_{columns},
        rows_{rows},
        levels_(static_cast<std::size_t>(columns)),
        row_(static_cast<std::size_t>(width)) {
    values_.resize(static_cast<std::size_t>(columns * rows));
  }
  float& at(int i, int j) { return values_[static_cast<std::size_t>(j * columns_ + i)]; }
  [[nodiscard]] const std::vector<std::uint8_t>& last() const { return row_; }
  /// The row at y, rounded and within 0..255, for comparison with pixels.
  const std::vector<std::uint8_t>& row(int y) {
    const float v =
        std::clamp((static_cast<float>(y) + 0.5F) / tile - 0.5F, 0.0F, static_cast<float>(rows_ - 1));
    const int j = std::min(static_cast<int>(v), std::max(0, rows_ - 2));
    const float share = rows_ > 1 ? v - static_cast<float>(j) : 0.0F;
    const int next = std::min(j + 1, rows_ - 1);
    const auto mixed = [&](int i) {
      return std::clamp(at(i, j) + share * (at(i, next) - at(i, j)), 0.0F, 255.0F);
    };
    for (int i = 0; i < columns_; ++i) levels_[static_cast<std::size_t>(i)] = mixed(i);
    interpolate(levels_, row_);
    return row_;
  }

 private:
  int columns_, rows_;
  std::vector<float> values_, levels_;
  std::vector<std::uint8_t> row_;
};

double median(std::vector<float>& values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

// 255 where `larger` lies above `smaller`.
INVAR_WIDE_VECTORS
void classify(const std::uint8_t* larger, const std::uint8_t* smaller, int width, std::uint8_t* mask) {
  for (int x = 0; x < width; ++x) mask[x] = larger[x] > smaller[x] ? 255 : 0;
}

// Pixels of a tile's row, or sums of such down the tile.
using TileBytes [[gnu::vector_size(tile)]] = std::uint8_t;
using TileWords [[gnu::vector_size(2 * tile)]] = std::uint16_t;

// The tile's sum and count of the sampled pixels, of those above `high` and of those below `low`.
struct TileCounts {
  float sum, count, above, above_count, below, below_count;
};

// `high`, `low`: the thresholds along the tile's middle.
INVAR_WIDE_VECTORS
TileCounts count_tile(const std::uint8_t* first, std::size_t stride, int rows, int columns,
                      const std::uint8_t* high, const std::uint8_t* low) {
  const auto load = [columns](const std::uint8_t* from, TileWords& to) {
    TileBytes bytes{};
    if (columns == tile) {
      std::memcpy(&bytes, from, sizeof bytes);
    } else {
      for (int k = 0; k < columns; ++k) bytes[k] = from[k];
    }
    to = __builtin_convertvector(bytes, TileWords);
  };
  TileWords p, h, l, sum{}, above{}, above_count{}, below{}, below_count{};
  load(high, h), load(low, l);  // beyond the image nothing is above or below
  for (int y = 0; y < rows; ++y) {
    load(first + static_cast<std::size_t>(y) * stride, p);
    const auto up = static_cast<TileWords>(p > h), down = static_cast<TileWords>(p < l);
    sum += p;
    above += p & up, above_count -= up;
    below += p & down, below_count -= down;
  }
  const auto total = [](const TileWords& words) {
    int all = 0;
    for (int k = 0; k < tile; ++k) all += words[k];
    return static_cast<float>(all);
  };
  return {total(sum),   static_cast<float>(rows * columns),
          total(above), total(above_count),
          total(below), total(below_count)};
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
  const auto difference = [&](int i, int j) {
    const float n = things_n.at(i, j), rest = whole_n.at(i, j) - n;
    if (n < enough || rest < enough) return 0.0F;
    return things.at(i, j) / n - (whole.at(i, j) - things.at(i, j)) / rest;
  };
  std::vector<float> differences;
  for (int j = 0; j < things.rows(); ++j)
    for (int i = 0; i < things.columns(); ++i)
      if (const float d = difference(i, j); d != 0.0F) differences.push_back(d);
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
      const float d = difference(i, j), n = things_n.at(i, j), rest = whole_n.at(i, j) - n;
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
  if (want_light) out.light.create(height, width);
  if (want_dark) out.dark.create(height, width);

  // Every tile's sampled rows, against thresholds along its middle.
  const auto for_each_tile = [&](TileField& high, TileField& low, const auto& take) {
    for (int j = 0; j < rows; ++j) {
      const int first = std::min(j * tile + first_row, height - 1), beyond = std::min(height, (j + 1) * tile);
      const auto &up = high.row(j * tile + tile / 2), &down = low.row(j * tile + tile / 2);
      for (int i = 0; i < columns; ++i)
        take(i, j,
             count_tile(image.ptr<std::uint8_t>(first) + i * tile, next_row * image.step,
                        (beyond - first + next_row - 1) / next_row, std::min(tile, width - i * tile),
                        up.data() + i * tile, down.data() + i * tile));
    }
  };

  // What lies clearly above or below its surroundings' mean.
  TileSums sum{columns, rows}, count{columns, rows};
  TileField high{columns, rows, width}, low{columns, rows, width};
  for_each_tile(high, low, [&](int i, int j, const TileCounts& tile_counts) {
    sum.at(i, j) = tile_counts.sum;
    count.at(i, j) = tile_counts.count;
  });
  TileField mean{columns, rows, width};
  {
    TileSums s = sum.windowed(window), n = count.windowed(window);
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) mean.at(i, j) = s.at(i, j) / n.at(i, j);
  }
  const int step = 2 * histogram_step(image);
  std::vector<std::uint8_t> distances(
      static_cast<std::size_t>(width * (1 + std::max(0, height - 1 - first_row) / step)));
  std::uint8_t* to = distances.data();
  for (int y = first_row; y < height; y += step, to += width)
    distance_of(image.ptr<std::uint8_t>(y), mean.row(y).data(), width, to);
  const int extreme = value_reached_by(
      distances, std::max(1, static_cast<int>(0.001 * static_cast<double>(distances.size()))));
  const double margin = std::max(5.0 * out.noise + 1.0, 0.2 * extreme);
  if (extreme <= margin) return out.light.setTo(0), out.dark.setTo(0), out;

  // Light things against the rest, and dark things against the rest: each class's local level, then the middle between
  // the two; twice, since the second time sees real classes.
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      high.at(i, j) = mean.at(i, j) + static_cast<float>(margin);
      low.at(i, j) = mean.at(i, j) - static_cast<float>(margin);
    }
  const TileSums whole = sum.windowed(window), whole_n = count.windowed(window);
  for (int pass = 0; pass < 2; ++pass) {
    TileSums above{columns, rows}, above_n{columns, rows}, below{columns, rows}, below_n{columns, rows};
    for_each_tile(high, low, [&](int i, int j, const TileCounts& tile_counts) {
      above.at(i, j) = tile_counts.above, above_n.at(i, j) = tile_counts.above_count;
      below.at(i, j) = tile_counts.below, below_n.at(i, j) = tile_counts.below_count;
    });
    if (want_light)
      out.light_contrast =
          set_thresholds(above.windowed(window), above_n.windowed(window), whole, whole_n, high);
    if (want_dark)
      out.dark_contrast =
          set_thresholds(below.windowed(window), below_n.windowed(window), whole, whole_n, low);
  }
  // What does not stand out from the noise is none.
  const double least = std::max(4.0 * out.noise, 2.0);
  if (out.light_contrast <= least) out.light_contrast = 0.0;
  if (-out.dark_contrast <= least) out.dark_contrast = 0.0;
  out.dark_contrast = -out.dark_contrast;
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* p = image.ptr<std::uint8_t>(y);
    const auto at = [y](TileField& threshold) {  // four rows hardly differ
      return (y % 4 == 0 ? threshold.row(y + 2) : threshold.last()).data();
    };
    if (want_light) classify(p, at(high), width, out.light.ptr<std::uint8_t>(y));
    if (want_dark) classify(at(low), p, width, out.dark.ptr<std::uint8_t>(y));
  }
  if (!(out.light_contrast > 0.0)) out.light.setTo(0);
  if (!(out.dark_contrast > 0.0)) out.dark.setTo(0);
  return out;
}

Blobs label_blobs(const cv::Mat1b& mask, double smallest) {
  Blobs out;
  auto& runs = out.runs;
  std::vector<int> parent;
  runs.reserve(4096);
  parent.reserve(4096);
  const auto root = [&](int i) {
    while (parent[static_cast<std::size_t>(i)] != i) {
      parent[static_cast<std::size_t>(i)] =
          parent[static_cast<std::size_t>(parent[static_cast<std::size_t>(i)])];
      i = parent[static_cast<std::size_t>(i)];
    }
    return i;
  };
  std::size_t above_begin = 0, above_end = 0;
  for (int y = 0; y < mask.rows; ++y) {
    const std::uint8_t* p = mask.ptr<std::uint8_t>(y);
    const std::size_t begin = runs.size();
    std::size_t above = above_begin;
    for (int x = 0; x < mask.cols;) {
      if (p[x] == 0) {
        const void* next = std::memchr(p + x, 255, static_cast<std::size_t>(mask.cols - x));
        if (next == nullptr) break;
        x = static_cast<int>(static_cast<const std::uint8_t*>(next) - p);
      }
      const int start = x;
      const void* end = std::memchr(p + x, 0, static_cast<std::size_t>(mask.cols - x));
      x = end == nullptr ? mask.cols : static_cast<int>(static_cast<const std::uint8_t*>(end) - p);
      const int id = static_cast<int>(runs.size());
      runs.push_back({y, start, x, 0});
      parent.push_back(id);
      while (above < above_end && runs[above].end < start) ++above;
      for (std::size_t k = above; k < above_end && runs[k].begin <= x; ++k) {
        const int a = root(static_cast<int>(k)), b = root(id);
        if (a != b) parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
      }
    }
    above_begin = begin;
    above_end = runs.size();
  }
  struct Sums {
    double n = 0, x = 0, y = 0, xx = 0, yy = 0;
    int left = 1 << 30, top = 1 << 30, right = -1, bottom = -1;
  };
  std::vector<int> set(runs.size(), -1);  // which blob a root is, counted as they come
  std::vector<Sums> sums;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    BlobRun& run = runs[i];
    int& which = set[static_cast<std::size_t>(root(static_cast<int>(i)))];
    if (which < 0) {
      which = static_cast<int>(sums.size());
      sums.emplace_back();
    }
    run.label = which;
    Sums& s = sums[static_cast<std::size_t>(which)];
    const double n = run.end - run.begin, middle = 0.5 * (run.begin + run.end - 1), y = run.y;
    s.n += n;
    s.x += n * middle;
    s.y += n * y;
    s.xx += n * (middle * middle + (n * n - 1.0) / 12.0);
    s.yy += n * y * y;
    s.left = std::min(s.left, run.begin);
    s.right = std::max(s.right, run.end - 1);
    s.top = std::min(s.top, run.y);
    s.bottom = std::max(s.bottom, run.y);
  }
  std::vector<int> label(sums.size(), -1);
  auto& blobs = out.blobs;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const Sums& s = sums[i];
    if (s.n < std::max(1.0, smallest)) continue;
    const double x = s.x / s.n, y = s.y / s.n;
    // Each pixel is a square of its own second moment, 1/12 each way.
    const double moment = s.xx - s.n * x * x + s.yy - s.n * y * y + s.n / 6.0;
    label[i] = static_cast<int>(blobs.size());
    blobs.push_back({label[i], s.n, x, y, s.n * s.n / (2.0 * std::numbers::pi * moment), s.left, s.top,
                     s.right, s.bottom});
  }
  for (BlobRun& run : runs) run.label = label[static_cast<std::size_t>(run.label)] + 1;
  return out;
}

cv::Mat1b mask_of(const Blobs& blobs, const Blob& blob) {
  cv::Mat1b mask(blob.bottom - blob.top + 3, blob.right - blob.left + 3, static_cast<std::uint8_t>(0));
  auto run = std::lower_bound(blobs.runs.begin(), blobs.runs.end(), blob.top,
                              [](const BlobRun& a, int y) { return a.y < y; });
  for (; run != blobs.runs.end() && run->y <= blob.bottom; ++run)
    if (run->label == blob.label + 1)
      std::memset(mask.ptr<std::uint8_t>(run->y - blob.top + 1) + run->begin - blob.left + 1, 255,
                  static_cast<std::size_t>(run->end - run->begin));
  return mask;
}

}  // namespace invar::vision
