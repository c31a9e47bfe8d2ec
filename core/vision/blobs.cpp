#include "core/vision/blobs.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/vision/partition.hpp"
#include "core/vision/wide_vectors.hpp"

namespace invar::vision {

namespace {

constexpr double round_enough =
    0.965;  // of area^2 / (2 pi moment): two touching discs reach 0.6, a 1.4:1 ellipse 0.94

constexpr double least_support = 0.18;  // of its circumference, in outline points; a circle with less is none

constexpr double finest = 2.4;  // px of a reduced image; smaller radii are looked for in a finer one

struct Side {
  int polarity = +1;
  Blobs found;
  double round_area = 0.0;  // px^2 of the reduced image
};

bool at_border(const Blob& blob, const cv::Mat1b& image) {
  return blob.left <= 0 || blob.top <= 0 || blob.right >= image.cols - 1 || blob.bottom >= image.rows - 1;
}

bool is_disc(const Blob& blob, const cv::Mat1b& image) {
  const double w = blob.right - blob.left + 1, h = blob.bottom - blob.top + 1;
  // Small discs are made of few pixels: their moments scatter.
  const double slack = 0.5 / std::sqrt(blob.area);
  return blob.roundness > round_enough - slack && std::max(w, h) < 1.35 * std::min(w, h) + 1.0 &&
         !at_border(blob, image);
}

Side make_side(const cv::Mat1b& image, const BitMask& mask, int polarity, double smallest) {
  Side side;
  side.polarity = polarity;
  side.found = label_blobs(mask, smallest);
  for (const Blob& blob : side.found.blobs)
    if (is_disc(blob, image)) side.round_area += blob.area;
  return side;
}

double weighted_median(std::vector<std::pair<double, double>> values) {  // (value, weight)
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  double total = 0.0;
  for (const auto& [value, weight] : values) total += weight;
  double sum = 0.0;
  for (const auto& [value, weight] : values)
    if ((sum += weight) >= 0.5 * total) return value;
  return values.back().first;
}

// Of pixels' distances, which neither overflow nor vanish: std::hypot, which minds that, takes five times as long.
template <class T>
T length_of(T x, T y) {
  return std::sqrt(x * x + y * y);
}

struct OutlinePoint {
  float x, y;    // px of the reduced image
  float nx, ny;  // unit, from the ground into the thing
  bool used;
};

std::vector<OutlinePoint> outline_of(const Blob& blob, const cv::Mat1b& image, const Side& side) {
  std::vector<OutlinePoint> points;
  const auto at = [&](int y, int x) {
    return static_cast<int>(image(std::clamp(y, 0, image.rows - 1), std::clamp(x, 0, image.cols - 1)));
  };
  const cv::Mat1b mask = mask_of(side.found, blob);
  for (int y = std::max(1, blob.top); y <= std::min(image.rows - 2, blob.bottom); ++y) {
    const std::uint8_t* row = mask.ptr<std::uint8_t>(y - blob.top + 1);
    const std::uint8_t *above = row - mask.step, *below = row + mask.step;
    for (int x = std::max(1, blob.left); x <= std::min(image.cols - 2, blob.right); ++x) {
      const int m = x - blob.left + 1;
      if (row[m] == 0 || (above[m] != 0 && below[m] != 0 && row[m - 1] != 0 && row[m + 1] != 0)) continue;
      const int gx = at(y - 1, x + 1) + 2 * at(y, x + 1) + at(y + 1, x + 1) - at(y - 1, x - 1) -
                     2 * at(y, x - 1) - at(y + 1, x - 1);
      const int gy = at(y + 1, x - 1) + 2 * at(y + 1, x) + at(y + 1, x + 1) - at(y - 1, x - 1) -
                     2 * at(y - 1, x) - at(y - 1, x + 1);
      const float length = length_of(static_cast<float>(gx), static_cast<float>(gy));
      if (length < 1.0F) continue;
      const auto sign = static_cast<float>(side.polarity);
      points.push_back({static_cast<float>(x), static_cast<float>(y), sign * static_cast<float>(gx) / length,
                        sign * static_cast<float>(gy) / length, false});
    }
  }
  return points;
}

// Kasa's circle through the outline points that belong to it; three rounds from a rough start. The mask's
// outermost pixel centres lie about 0.4 px inside the outline.
struct Found {
  double x, y, radius;
  int support;
};
Found refine(const std::vector<OutlinePoint>& points, Found at) {
  for (int round = 0; round < 3; ++round) {
    const double tolerance = std::max(1.0, 0.2 * at.radius);
    double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0, sxz = 0, syz = 0, sz = 0;
    for (const OutlinePoint& p : points) {
      if (p.used) continue;
      const double dx = static_cast<double>(p.x) - at.x, dy = static_cast<double>(p.y) - at.y;
      const double r = length_of(dx, dy);
      if (std::abs(r - at.radius) > tolerance ||
          dx * static_cast<double>(p.nx) + dy * static_cast<double>(p.ny) > -0.8 * r)
        continue;
      const double z = dx * dx + dy * dy;
      n += 1, sx += dx, sy += dy, sxx += dx * dx, sxy += dx * dy, syy += dy * dy, sxz += dx * z,
          syz += dy * z, sz += z;
    }
    at.support = static_cast<int>(n);
    if (n < 5) return at;
    const cv::Matx33d normal(sxx, sxy, sx, sxy, syy, sy, sx, sy, n);
    const cv::Vec3d rhs(-sxz, -syz, -sz);
    cv::Vec3d s;
    if (!cv::solve(normal, rhs, s, cv::DECOMP_CHOLESKY)) return at;
    const double x = -0.5 * s[0], y = -0.5 * s[1], square = x * x + y * y - s[2];
    // A short arc may throw the circle far off; then the start is better.
    if (!(square > 0.0) || std::hypot(x, y) > 0.5 * at.radius ||
        std::abs(std::sqrt(square) - at.radius) > 0.35 * at.radius)
      return at;
    at.x += x;
    at.y += y;
    at.radius = std::sqrt(square);
  }
  return at;
}

// One row of counts onto another.
void add_row(const std::int16_t* from, int length, std::int16_t* to) {
  for (int x = 0; x < length; ++x) to[x] = static_cast<std::int16_t>(to[x] + from[x]);
}
void take_row(const std::int16_t* from, int length, std::int16_t* to) {
  for (int x = 0; x < length; ++x) to[x] = static_cast<std::int16_t>(to[x] - from[x]);
}
std::int16_t largest_of(const std::int16_t* row, int length) {
  std::int16_t largest = 0;
  for (int x = 0; x < length; ++x) largest = std::max(largest, row[x]);
  return largest;
}

// Votes for centres, over the box of a blob and a margin.
class Votes {
 public:
  Votes(const Blob& blob, double radius)
      : radius_{static_cast<float>(radius)},
        reach_{std::max(1, static_cast<int>(0.15 * radius))},
        margin_{static_cast<int>(std::ceil(radius)) + 1},
        left_{blob.left - margin_},
        top_{blob.top - margin_},
        columns_{blob.right - blob.left + 1 + 2 * margin_},
        rows_{blob.bottom - blob.top + 1 + 2 * margin_},
        stride_{columns_ + 2 * reach_},
        cells_(static_cast<std::size_t>(stride_ * rows_)),
        down_(static_cast<std::size_t>(stride_)),
        both_(static_cast<std::size_t>(columns_)) {}

  /// An outline point votes, or takes its votes back (-1): along its normal, as its radius is known to some percent.
  void add(const OutlinePoint& p, int votes) {
    constexpr float unit = 1 << 14;  // a px in whole numbers, which are rounded at less cost
    const float start = 0.76F * radius_ * unit, step = 0.08F * radius_ * unit;
    auto x = static_cast<std::int32_t>((p.x - static_cast<float>(left_) + 0.5F) * unit + start * p.nx),
         y = static_cast<std::int32_t>((p.y - static_cast<float>(top_) + 0.5F) * unit + start * p.ny);
    const auto step_x = static_cast<std::int32_t>(step * p.nx),
               step_y = static_cast<std::int32_t>(step * p.ny);
    for (int k = 0; k < 7; ++k, x += step_x, y += step_y) {
      const int column = x >> 14, row = y >> 14;
      if (column < 0 || row < 0 || column >= columns_ || row >= rows_) continue;
      std::int16_t& cell = cells_[index(column, row)];
      cell = static_cast<std::int16_t>(cell + votes);
    }
  }
  /// Where a small square holds the most votes, and how many.
  struct Peak {
    int x, y;  // px of the reduced image
    double height;
  };
  Peak peak() {
    std::int16_t most = -1;
    int at_x = 0, at_y = 0;
    std::fill(down_.begin(), down_.end(), std::int16_t{0});
    const auto row = [&](int y) { return cells_.data() + y * stride_; };
    for (int y = -reach_; y < rows_; ++y) {
      if (y + reach_ < rows_) add_row(row(y + reach_), stride_, down_.data());
      if (y - reach_ - 1 >= 0) take_row(row(y - reach_ - 1), stride_, down_.data());
      if (y < 0) continue;
      std::copy_n(down_.begin(), columns_, both_.begin());
      for (int k = 1; k <= 2 * reach_; ++k) add_row(down_.data() + k, columns_, both_.data());
      const std::int16_t highest = largest_of(both_.data(), columns_);
      if (highest <= most) continue;
      most = highest, at_y = y;
      at_x = static_cast<int>(std::find(both_.begin(), both_.end(), highest) - both_.begin());
    }
    return {at_x + left_, at_y + top_, static_cast<double>(most)};
  }

 private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y * stride_ + reach_ + x);
  }
  float radius_;
  int reach_, margin_, left_, top_, columns_, rows_, stride_;
  std::vector<std::int16_t> cells_;  // with a margin of `reach_` left and right
  std::vector<std::int16_t> down_, both_;
};

// Takes a blob apart: every outline point votes for centres along its normal; the best circle is taken, its points
// are removed, and so on.
std::vector<Found> take_apart(const Blob& blob, const cv::Mat1b& image, const Side& side, double radius) {
  std::vector<Found> found;
  auto points = outline_of(blob, image, side);
  Votes votes{blob, radius};
  for (const OutlinePoint& p : points) votes.add(p, 1);
  const double whole = 2.0 * std::numbers::pi * radius;
  auto unused = static_cast<double>(points.size());
  for (int circles = 0; circles < 200 && unused >= least_support * whole; ++circles) {
    const Votes::Peak peak = votes.peak();
    if (peak.height < 0.15 * whole) break;
    Found at = refine(points, {static_cast<double>(peak.x), static_cast<double>(peak.y), radius - 0.4, 0});
    const double reach = std::max(1.2, 0.22 * at.radius);
    int removed = 0;
    for (OutlinePoint& p : points) {
      if (p.used) continue;
      const double r = length_of(static_cast<double>(p.x) - at.x, static_cast<double>(p.y) - at.y);
      // The votes that made the peak go, too, so that the same peak never comes twice.
      const double vx = static_cast<double>(p.x) + radius * static_cast<double>(p.nx) - peak.x;
      const double vy = static_cast<double>(p.y) + radius * static_cast<double>(p.ny) - peak.y;
      if (std::abs(r - at.radius) >= reach && length_of(vx, vy) >= 0.25 * radius) continue;
      p.used = true, ++removed;
      votes.add(p, -1);
    }
    if (removed == 0) break;
    unused -= removed;
    at.radius += 0.4;
    if (at.support >= least_support * whole) found.push_back(at);
  }
  return found;
}

double inscribed_radius(const Blob& blob, const Side& side) {
  cv::Mat1f distance;
  cv::distanceTransform(mask_of(side.found, blob), distance, cv::DIST_L2, 5);
  double largest = 0.0;
  cv::minMaxLoc(distance, nullptr, &largest);
  return largest;
}

// The mean of each two by two pixels.
INVAR_WIDE_VECTORS
void halve_row(const std::uint8_t* upper, const std::uint8_t* lower, int width, std::uint8_t* out) {
  using Words [[gnu::vector_size(32)]] = std::uint16_t;  // two pixels each
  using Bytes [[gnu::vector_size(16)]] = std::uint8_t;
  constexpr int lanes = 16;
  int x = 0;
  for (; x + lanes <= width; x += lanes) {
    Words a, b;
    std::memcpy(&a, upper + 2 * x, sizeof a);
    std::memcpy(&b, lower + 2 * x, sizeof b);
    const Bytes mean = __builtin_convertvector(((a & 255) + (a >> 8) + (b & 255) + (b >> 8) + 2) >> 2, Bytes);
    std::memcpy(out + x, &mean, sizeof mean);
  }
  for (; x < width; ++x)
    out[x] = static_cast<std::uint8_t>(
        (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) >> 2);
}

cv::Mat1b halved(const cv::Mat1b& image) {
  cv::Mat1b out(image.rows / 2, image.cols / 2);
  for (int y = 0; y < out.rows; ++y)
    halve_row(image.ptr<std::uint8_t>(2 * y), image.ptr<std::uint8_t>(2 * y + 1), out.cols,
              out.ptr<std::uint8_t>(y));
  return out;
}

struct Level {
  cv::Mat1b image;
  int halvings = 0;
};

struct Seen {
  Detection found;
  bool polarity_is_sure = false;
};

Seen detect_at(const Level& level, const DetectionOptions& options) {
  const cv::Mat1b& image = level.image;
  const double scale = 1 << level.halvings;
  Seen seen;
  Detection& out = seen.found;
  const Partition parts = partition(image, options.window, options.polarity);
  out.noise = parts.noise * scale;
  if (!(parts.light_contrast > 0.0) && !(parts.dark_contrast > 0.0)) return seen;
  const double smallest = 3.0;
  Side light, dark;
  if (options.polarity >= 0) light = make_side(image, parts.light, +1, smallest);
  if (options.polarity <= 0) dark = make_side(image, parts.dark, -1, smallest);
  // Things are round, what lies between them is not.
  Side* side = light.round_area >= dark.round_area ? &light : &dark;
  if (options.polarity != 0) {
    side = options.polarity > 0 ? &light : &dark;
  } else if (light.round_area + dark.round_area <=
             0.0) {  // everything touches: what borders the image less is the things
    const auto inner = [&](const Side& s) {
      double area = 0.0;
      for (const Blob& blob : s.found.blobs)
        if (!at_border(blob, image)) area += blob.area;
      return area;
    };
    side = inner(light) >= inner(dark) ? &light : &dark;
  }
  seen.polarity_is_sure = std::max(light.round_area, dark.round_area) >
                          4.0 * std::min(light.round_area, dark.round_area) + 0.02 * image.size().area();
  out.polarity = side->polarity;
  out.contrast = side->polarity > 0 ? parts.light_contrast : parts.dark_contrast;

  std::vector<std::pair<double, double>> radii;
  for (const Blob& blob : side->found.blobs)
    if (is_disc(blob, image)) radii.emplace_back(std::sqrt(blob.area / std::numbers::pi), blob.area);
  if (radii.empty())
    for (const Blob& blob : side->found.blobs) radii.emplace_back(inscribed_radius(blob, *side), blob.area);
  const double radius = weighted_median(radii);
  out.radius = radius * scale;
  if (!(radius > 0.0) || (level.halvings > 0 && options.level < 0 && radius < finest)) return seen;

  const auto full = [&](double v) { return (v + 0.5) * scale - 0.5; };
  for (const Blob& blob : side->found.blobs) {
    if (is_disc(blob, image)) {
      out.candidates.push_back(
          {full(blob.x), full(blob.y), std::sqrt(blob.area / std::numbers::pi) * scale, true});
    } else if (blob.area > 0.12 * std::numbers::pi * radius * radius) {
      const auto parts_of = take_apart(blob, image, *side, radius);
      for (const Found& f : parts_of)
        out.candidates.push_back(
            {full(f.x), full(f.y), f.radius * scale, parts_of.size() == 1 && !at_border(blob, image)});
    }
  }
  return seen;
}

}  // namespace

Detection detect(const cv::Mat& image, const DetectionOptions& options) {
  std::vector<Level> levels{{image, 0}};
  const auto halve_to = [&](int halvings) {
    while (levels.back().halvings < halvings)
      levels.push_back({halved(levels.back().image), levels.back().halvings + 1});
    return levels[static_cast<std::size_t>(halvings)];
  };
  if (options.level >= 0) return detect_at(halve_to(options.level), options).found;
  // Coarse first: it is cheap and sees through noise. Finer where the things turn out small there.
  int halvings = 0;
  while (std::min(image.cols, image.rows) >> (halvings + 1) >= 96) ++halvings;
  DetectionOptions known = options;
  for (;;) {
    const auto [found, polarity_is_sure] = detect_at(halve_to(halvings), known);
    if (polarity_is_sure) known.polarity = found.polarity;  // the finer image has four times as many pixels
    if (halvings == 0 || (found.radius >= finest * (1 << halvings) && !found.candidates.empty()))
      return found;
    --halvings;
    while (halvings > 0 && found.radius > 0.0 && found.radius < finest * (1 << halvings)) --halvings;
  }
}

}  // namespace invar::vision
