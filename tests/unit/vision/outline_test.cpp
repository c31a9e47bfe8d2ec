// The outline by its edge profile beside the usual way - edge points, Taubin's circle, robust geometric fit - on the same
// rendered drops, whose truth is known.
#include <gmock/gmock.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "core/metrology/camera/circle_fit.hpp"
#include "core/vision/droplets.hpp"
#include "core/vision/render.hpp"

namespace invar::vision {
namespace {

double between_pixels(const cv::Mat& image, double x, double y) {
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const double a = x - i, b = y - j;
  const auto at = [&](int row, int column) {
    return static_cast<double>(image.at<std::uint8_t>(row, column));
  };
  return (1 - b) * ((1 - a) * at(j, i) + a * at(j, i + 1)) +
         b * ((1 - a) * at(j + 1, i) + a * at(j + 1, i + 1));
}

/// Where the image passes halfway from the level inside to the level outside, to parts of a pixel, along rays from near the
/// centre: what any method of edge points begins with. Levels are those of each ray, so that shading is followed.
Eigen::Matrix2Xd edge_points(const cv::Mat& image, const RenderedDisc& disc, double blur, int rays) {
  constexpr double step = 0.25;
  const double reach = 2.5 * blur + 2.0;
  std::vector<Eigen::Vector2d> points;
  for (int k = 0; k < rays; ++k) {
    const double angle = 2.0 * std::numbers::pi * (k + 0.5) / rays;
    const Eigen::Vector2d along{std::cos(angle), std::sin(angle)}, centre{disc.x, disc.y};
    const auto level = [&](double r) {
      const Eigen::Vector2d at = centre + r * along;
      return between_pixels(image, at.x(), at.y());
    };
    const double inside = 0.5 * (level(disc.radius - reach) + level(disc.radius - reach + 1.0)),
                 outside = 0.5 * (level(disc.radius + reach) + level(disc.radius + reach - 1.0)),
                 middle = 0.5 * (inside + outside);
    for (double r = disc.radius - reach; r < disc.radius + reach; r += step) {
      const double here = level(r) - middle, next = level(r + step) - middle;
      if (here * next > 0.0) continue;
      // The curvature of a blurred disc pulls the edge inward by blur^2/(2 R): told to this way, found out by ours.
      points.emplace_back(centre +
                          (r + step * here / (here - next) + blur * blur / (2.0 * disc.radius)) * along);
      break;
    }
  }
  return Eigen::Map<Eigen::Matrix2Xd>(points.front().data(), 2, static_cast<Eigen::Index>(points.size()));
}

/// Middles of the pixels of the drop that have a neighbour outside, by a threshold halfway: what a contour consists of.
Eigen::Matrix2Xd contour_points(const cv::Mat& image, const RenderedDisc& disc, double threshold) {
  std::vector<Eigen::Vector2d> points;
  const int reach = static_cast<int>(disc.radius) + 5, x0 = static_cast<int>(disc.x),
            y0 = static_cast<int>(disc.y);
  const auto inside = [&](int y, int x) { return image.at<std::uint8_t>(y, x) > threshold; };
  for (int y = y0 - reach; y <= y0 + reach; ++y)
    for (int x = x0 - reach; x <= x0 + reach; ++x)
      if (inside(y, x) && !(inside(y - 1, x) && inside(y + 1, x) && inside(y, x - 1) && inside(y, x + 1)))
        points.emplace_back(x, y);
  return Eigen::Map<Eigen::Matrix2Xd>(points.front().data(), 2, static_cast<Eigen::Index>(points.size()));
}

struct Errors {
  double square = 0.0, radius = 0.0;
  int count = 0;
  void add(double dx, double dy, double dr) { square += dx * dx + dy * dy, radius += dr, ++count; }
  [[nodiscard]] double rms() const { return std::sqrt(square / count); }
  [[nodiscard]] double bias() const { return radius / count; }
};

struct Circumstance {
  const char* name;
  std::function<void(Scene&, std::mt19937_64&)> make;
};

class OutlineFits : public ::testing::TestWithParam<Circumstance> {};

TEST_P(OutlineFits, AreAtLeastAsExactByTheProfileAsByTaubinAndARobustGeometricFit) {
  constexpr std::uint64_t seed = 41;
  std::mt19937_64 random{seed};
  const auto between = [&](double a, double b) {
    return std::uniform_real_distribution<double>{a, b}(random);
  };
  Errors profile, same_rays, all_pixels, contour;
  for (int trial = 0; trial < 60; ++trial) {
    Scene scene;
    scene.width = scene.height = 160;
    scene.seed = seed + static_cast<std::uint64_t>(trial);
    scene.blur = between(0.8, 1.4);
    scene.discs.push_back(
        {.x = between(70.0, 90.0), .y = between(70.0, 90.0), .radius = between(10.0, 40.0)});
    GetParam().make(scene, random);
    const cv::Mat image = render(scene);
    const RenderedDisc& truth = scene.discs.front();
    const Droplets found = measure_droplets(image, {.polarity = +1});
    const Droplet* drop = nullptr;
    for (const Droplet& one : found.droplets)
      if (std::hypot(one.x - truth.x, one.y - truth.y) < 0.3 * truth.radius) drop = &one;
    ASSERT_NE(drop, nullptr) << "trial " << trial << ", seed " << seed;
    profile.add(drop->x - truth.x, drop->y - truth.y, drop->radius - truth.radius);
    const auto add = [&](const Eigen::Matrix2Xd& points, Errors& errors) {
      const auto fit = metrology::robust_circle(points);  // Taubin, then geometric, reweighted
      ASSERT_TRUE(fit);
      errors.add(fit->circle.center.x() - truth.x, fit->circle.center.y() - truth.y,
                 fit->circle.radius - truth.radius);
    };
    // As many rays as `measure_droplets` has for such a drop, and one a pixel of the outline.
    Rays rays;
    rays.choose(std::max(10.0, (scene.noise > 6.0 ? 0.8 : 0.6) * truth.radius));
    add(edge_points(image, truth, scene.blur, rays.count), same_rays);
    add(edge_points(image, truth, scene.blur,
                    static_cast<int>(std::lround(2.0 * std::numbers::pi * truth.radius))),
        all_pixels);
    add(contour_points(image, truth, 0.5 * (scene.foreground + scene.background)), contour);
  }
  std::printf("%s, seed %d: centre RMS / radius bias [px]\n", GetParam().name, static_cast<int>(seed));
  const auto tell = [](const char* what, const Errors& errors) {
    std::printf("  %.4f / %+.4f  %s\n", errors.rms(), errors.bias(), what);
  };
  tell("profile", profile);
  tell("edge points of as many rays, Taubin, robust geometric", same_rays);
  tell("edge points of a ray a pixel, Taubin, robust geometric", all_pixels);
  tell("pixels of the contour, Taubin, robust geometric", contour);
  EXPECT_LE(profile.rms(), same_rays.rms());
  EXPECT_LE(std::abs(profile.bias()), std::abs(same_rays.bias()) + 0.002);
  EXPECT_LE(profile.rms(), 0.7 * contour.rms());
  EXPECT_LT(contour.bias(), -0.2) << "the outline of pixel middles lies inside";
}

INSTANTIATE_TEST_SUITE_P(
    Where, OutlineFits,
    ::testing::Values(Circumstance{"clean", [](Scene&, std::mt19937_64&) {}},
                      Circumstance{"noisy", [](Scene& scene, std::mt19937_64&) { scene.noise = 8.0; }},
                      Circumstance{"shaded",
                                   [](Scene& scene, std::mt19937_64& random) {
                                     std::uniform_real_distribution<double> slope{-0.25, 0.25};
                                     scene.discs.front().gradient_x = slope(random);
                                     scene.discs.front().gradient_y = slope(random);
                                     scene.light_slope_x = 2.0 * slope(random);
                                   }},
                      Circumstance{
                          "with_a_satellite_on_the_edge",
                          [](Scene& scene, std::mt19937_64& random) {
                            const double angle = std::uniform_real_distribution<double>{0.0, 6.28}(random);
                            const RenderedDisc drop = scene.discs.front();
                            scene.discs.push_back({.x = drop.x + 1.05 * drop.radius * std::cos(angle),
                                                   .y = drop.y + 1.05 * drop.radius * std::sin(angle),
                                                   .radius = 0.15 * drop.radius});
                          }}),
    [](const auto& one) { return std::string{one.param.name}; });

}  // namespace
}  // namespace invar::vision
