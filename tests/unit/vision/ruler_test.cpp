#include "core/vision/ruler.hpp"

#include <gmock/gmock.h>

#include <cstdio>
#include <random>

#include "core/vision/render.hpp"

namespace invar::vision {
namespace {

using Eigen::Vector2d;

// Four circles in a row that is not quite one, as a ruler lies under a camera: radii 0.5, 1, 1.5 and 2 mm.
Scene ruler_scene(std::uint64_t seed, double px_per_mm) {
  std::mt19937_64 random{seed};
  std::uniform_real_distribution<double> jitter{-20.0, 20.0};
  Scene scene;
  scene.seed = seed;
  scene.noise = 2.0;
  scene.light_slope_x = 0.2;
  const double xs[] = {110.0, 290.0, 560.0, 950.0}, radii[] = {0.5, 1.0, 1.5, 2.0};
  for (int i = 0; i < 4; ++i)
    scene.discs.push_back(
        {.x = xs[i] + jitter(random), .y = 400.0 + 5.0 * jitter(random), .radius = radii[i] * px_per_mm});
  return scene;
}

TEST(Ruler, ScaleIsRightWithinTwoPartsInTenThousandAndItsSigmaIsHonest) {
  RulerFailure failure;
  double chi = 0.0;
  constexpr int trials = 8;
  for (int i = 0; i < trials; ++i) {
    const double px_per_mm = 70.0 + 2.37 * i;
    const cv::Mat image = render(ruler_scene(static_cast<std::uint64_t>(50 + i), px_per_mm));
    const auto fit = calibrate_ruler(image, {1.5e-3, 0.5e-3, 2.0e-3, 1.0e-3}, failure);
    ASSERT_TRUE(fit) << failure.what;
    const double error = fit->camera.scale * px_per_mm * 1e3 - 1.0;
    EXPECT_LT(std::abs(error), 2e-4) << "seed " << 50 + i;
    EXPECT_FALSE(fit->distortion_identified) << "seed " << 50 + i;
    EXPECT_FALSE(fit->aspect_identified) << "seed " << 50 + i;
    chi += std::pow(error * fit->camera.scale / fit->camera.scale_sigma, 2) / trials;
    EXPECT_DOUBLE_EQ(fit->circles[0].radius, 1.5e-3);  // in the order given
    EXPECT_NEAR(fit->circles[0].outline.radius, 1.5 * px_per_mm, 0.05);
  }
  std::printf("seeds 50..57: scale error over sigma, RMS %.2f\n", std::sqrt(chi));
  EXPECT_LT(chi, 9.0);
}

TEST(Ruler, DistortionIsFoundWhereItIs) {
  RulerFailure failure;
  for (const double strength : {-0.006, 0.006}) {
    Scene scene = ruler_scene(77, 80.0);
    scene.distortion = strength;
    const auto fit = calibrate_ruler(render(scene), {0.5e-3, 1.0e-3, 1.5e-3, 2.0e-3}, failure);
    ASSERT_TRUE(fit) << failure.what;
    ASSERT_TRUE(fit->distortion_identified);
    EXPECT_NEAR(fit->camera.scale * 80.0e3, 1.0, 2e-4);
    const double corner = 0.25 * (1200.0 * 1200.0 + 800.0 * 800.0);
    EXPECT_NEAR(fit->camera.distortion * corner, strength, 4e-4);
    // A point seen through the lens goes back to where it is.
    const cv::Point2d seen = seen_at(scene, 1100.0, 700.0);
    const Vector2d metres = fit->camera.to_metres({seen.x, seen.y});
    EXPECT_NEAR(metres.x() * 80.0e3, 1100.0, 0.5);
  }
}

TEST(Ruler, TheWrongNumberOfCirclesIsSaidInWords) {
  RulerFailure failure;
  Scene scene = ruler_scene(5, 80.0);
  scene.discs.pop_back();
  EXPECT_FALSE(calibrate_ruler(render(scene), {0.5e-3, 1.0e-3, 1.5e-3, 2.0e-3}, failure));
  EXPECT_THAT(failure.what, ::testing::HasSubstr("shows 3 circles, the ruler has 4"));
}

TEST(Ruler, SizesThatDoNotMatchAreRefused) {
  RulerFailure failure;
  Scene scene = ruler_scene(5, 80.0);
  scene.discs[2].radius *= 0.93;
  EXPECT_FALSE(calibrate_ruler(render(scene), {0.5e-3, 1.0e-3, 1.5e-3, 2.0e-3}, failure));
  EXPECT_THAT(failure.what, ::testing::HasSubstr("do not match"));
}

TEST(Camera, MetresAndPixelsAreInverse) {
  CameraModel camera;
  camera.scale = 1e-5;
  camera.aspect = 1.01;
  camera.distortion = 1.2e-8;
  camera.center = {599.5, 399.5};
  for (const Vector2d& seen :
       {Vector2d{0.0, 0.0}, Vector2d{1199.0, 3.0}, Vector2d{599.5, 399.5}, Vector2d{700.0, 100.0}}) {
    const auto back = camera.to_pixels(camera.to_metres(seen));
    ASSERT_TRUE(back);
    EXPECT_NEAR((*back - seen).norm(), 0.0, 1e-8);
    // The local scale is the root of the area scale: finite differences.
    const double step = 0.01;
    const Vector2d dx =
        camera.to_metres(seen + Vector2d{step, 0}) - camera.to_metres(seen - Vector2d{step, 0});
    const Vector2d dy =
        camera.to_metres(seen + Vector2d{0, step}) - camera.to_metres(seen - Vector2d{0, step});
    const double area = (dx.x() * dy.y() - dx.y() * dy.x()) / (4.0 * step * step);
    EXPECT_NEAR(camera.local_scale(seen) / std::sqrt(area), 1.0, 1e-6);
  }
}

}  // namespace
}  // namespace invar::vision
