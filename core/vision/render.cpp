#include "core/vision/render.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

namespace invar::vision {

namespace {

constexpr int subsamples = 8;  // a side; edges are anti-aliased by the pixel's own area

struct Lens {
  double x, y, strength;  // centre [px], 1/px^2
  explicit Lens(const Scene& scene)
      : x{0.5 * (scene.width - 1)},
        y{0.5 * (scene.height - 1)},
        strength{4.0 * scene.distortion / (std::pow(scene.width, 2) + std::pow(scene.height, 2))} {}
  [[nodiscard]] cv::Point2d ideal(double u, double v) const {
    const double dx = u - x, dy = v - y;
    const double factor = 1.0 + strength * (dx * dx + dy * dy);
    return {x + dx * factor, y + dy * factor};
  }
  [[nodiscard]] cv::Point2d seen(double u, double v) const {
    cv::Point2d at{u, v};
    for (int i = 0; i < 50; ++i) {
      const cv::Point2d there = ideal(at.x, at.y);
      at += cv::Point2d{u - there.x, v - there.y};
    }
    return at;
  }
};

struct Ellipse {
  double x, y, c, s, major, minor;
  explicit Ellipse(const RenderedDisc& disc)
      : x{disc.x},
        y{disc.y},
        c{std::cos(disc.angle)},
        s{std::sin(disc.angle)},
        major{disc.radius / std::sqrt(disc.axis_ratio)},
        minor{disc.radius * std::sqrt(disc.axis_ratio)} {}
  // 1 on the outline, below inside.
  [[nodiscard]] double level(cv::Point2d p) const {
    const double dx = p.x - x, dy = p.y - y;
    const double a = (c * dx + s * dy) / major, b = (c * dy - s * dx) / minor;
    return std::sqrt(a * a + b * b);
  }
};

// Adds what the disc gives beyond the background, in shares of the contrast; where discs overlap, the later one covers.
void draw(const RenderedDisc& disc, const Lens& lens, cv::Mat1f& share) {
  const Ellipse ellipse{disc};
  const cv::Point2d at = lens.seen(disc.x, disc.y);
  const double reach = 1.1 * ellipse.major + 3.0;
  const int left = std::max(0, static_cast<int>(at.x - reach)),
            top = std::max(0, static_cast<int>(at.y - reach));
  const int right = std::min(share.cols - 1, static_cast<int>(at.x + reach));
  const int bottom = std::min(share.rows - 1, static_cast<int>(at.y + reach));
  for (int v = top; v <= bottom; ++v)
    for (int u = left; u <= right; ++u) {
      const cv::Point2d centre = lens.ideal(u, v);
      const double distance = (ellipse.level(centre) - 1.0) * ellipse.minor;
      double coverage = distance < 0.0 ? 1.0 : 0.0;
      if (std::abs(distance) < 1.5) {
        int inside = 0;
        for (int j = 0; j < subsamples; ++j)
          for (int i = 0; i < subsamples; ++i)
            inside += ellipse.level(lens.ideal(u + (i + 0.5) / subsamples - 0.5,
                                               v + (j + 0.5) / subsamples - 0.5)) < 1.0;
        coverage = inside / static_cast<double>(subsamples * subsamples);
      }
      if (coverage <= 0.0) continue;
      const double dx = (centre.x - disc.x) / disc.radius, dy = (centre.y - disc.y) / disc.radius;
      double value = 1.0 + disc.gradient_x * dx + disc.gradient_y * dy;
      if (disc.glare != 0.0)  // a lamp above left
        value +=
            disc.glare * std::exp(-0.5 * (std::pow(dx + 0.45, 2) + std::pow(dy + 0.45, 2)) / (0.12 * 0.12));
      float& pixel = share(v, u);
      pixel = static_cast<float>((1.0 - coverage) * static_cast<double>(pixel) + coverage * value);
    }
}

void draw(const RenderedScratch& scratch, cv::Mat1f& share) {
  const double dx = scratch.x1 - scratch.x0, dy = scratch.y1 - scratch.y0;
  const double square = dx * dx + dy * dy;
  for (int v = 0; v < share.rows; ++v)
    for (int u = 0; u < share.cols; ++u) {
      const double t = std::clamp(((u - scratch.x0) * dx + (v - scratch.y0) * dy) / square, 0.0, 1.0);
      const double away = std::hypot(u - scratch.x0 - t * dx, v - scratch.y0 - t * dy) - 0.5 * scratch.width;
      if (away < 0.5) share(v, u) += static_cast<float>(scratch.strength * std::min(1.0, 0.5 - away));
    }
}

void speckle(const Scene& scene, std::mt19937_64& random, cv::Mat1f& share) {
  std::uniform_real_distribution<double> unit{0.0, 1.0};
  for (int k = 0; k < scene.dust; ++k) {
    double x = unit(random) * scene.width, y = unit(random) * scene.height;
    const double strength = 0.3 + 0.7 * unit(random);
    for (int grain = 0; grain < 4; ++grain) {  // specks are not round
      const double radius = 0.5 + 2.0 * unit(random);
      for (int v = static_cast<int>(y - 4); v <= static_cast<int>(y + 4); ++v)
        for (int u = static_cast<int>(x - 4); u <= static_cast<int>(x + 4); ++u)
          if (u >= 0 && v >= 0 && u < share.cols && v < share.rows) {
            const double cover = std::clamp(radius - std::hypot(u - x, v - y) + 0.5, 0.0, 1.0);
            share(v, u) = std::max(share(v, u), static_cast<float>(strength * cover));
          }
      x += 4.0 * (unit(random) - 0.5);
      y += 4.0 * (unit(random) - 0.5);
    }
  }
}

}  // namespace

cv::Point2d seen_at(const Scene& scene, double x, double y) { return Lens{scene}.seen(x, y); }

cv::Mat render(const Scene& scene) {
  std::mt19937_64 random{scene.seed};
  const Lens lens{scene};
  cv::Mat1f share(scene.height, scene.width, 0.0F);
  speckle(scene, random, share);
  for (const RenderedDisc& disc : scene.discs) draw(disc, lens, share);
  for (const RenderedScratch& scratch : scene.scratches) draw(scratch, share);
  if (scene.blur > 0.0) cv::GaussianBlur(share, share, {}, scene.blur, scene.blur, cv::BORDER_REPLICATE);

  cv::Mat1f blotches(scene.height, scene.width, 0.0F);
  std::normal_distribution<double> normal{0.0, 1.0};
  if (scene.clutter > 0.0) {
    cv::Mat1f grid(scene.height / 25 + 2, scene.width / 25 + 2);
    for (float& value : grid) value = static_cast<float>(scene.clutter * normal(random));
    cv::resize(grid, blotches, blotches.size(), 0, 0, cv::INTER_CUBIC);
  }
  cv::Mat1b image(scene.height, scene.width);
  const double corner = std::hypot(lens.x, lens.y);
  for (int v = 0; v < scene.height; ++v)
    for (int u = 0; u < scene.width; ++u) {
      const double light =
          (1.0 + scene.light_slope_x * (u / (scene.width - 1.0) - 0.5) +
           scene.light_slope_y * (v / (scene.height - 1.0) - 0.5)) *
          (1.0 - scene.vignetting * std::pow(std::hypot(u - lens.x, v - lens.y) / corner, 2));
      const double value = light * (scene.background + (scene.foreground - scene.background) *
                                                           static_cast<double>(share(v, u))) +
                           static_cast<double>(blotches(v, u)) + scene.noise * normal(random);
      image(v, u) = static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L));
    }
  if (scene.jpeg_quality > 0) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, scene.jpeg_quality});
    return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  }
  return image;
}

}  // namespace invar::vision
