#include "core/vision/droplets.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

#include "tests/unit/vision/scenes.hpp"

namespace invar::vision {
namespace {

using testing::Figures;
using testing::Recipe;

// What every recipe must reach, over seeds that no number in the code was chosen by.
struct Bar {
  const char* recipe;
  double centre_rms, radius_bias;  // px
};

class RandomScenes : public ::testing::TestWithParam<Bar> {};

TEST_P(RandomScenes, AreMeasuredWithinTheBars) {
  const auto all = testing::recipes();
  const auto recipe =
      std::find_if(all.begin(), all.end(), [](const Recipe& r) { return r.name == GetParam().recipe; });
  ASSERT_NE(recipe, all.end());
  Figures figures;
  for (std::uint64_t seed = 1001; seed < 1004; ++seed) {
    const auto scene = testing::make_scene(*recipe, seed);
    figures.add(testing::judge(scene, measure_droplets(render(scene.scene))));
  }
  std::printf(
      "%s, seeds 1001..1003: %d drops, recall %.4f, precision %.4f, centre %.4f px, radius %+.4f px\n",
      GetParam().recipe, figures.drops, figures.recall(), figures.precision(), figures.centre_rms(),
      figures.radius_bias());
  for (const auto& fault : figures.faults) std::printf("  %s\n", fault.c_str());
  EXPECT_GE(figures.free_recall(), 0.99);
  EXPECT_GE(figures.recall(), 0.98);
  EXPECT_GE(figures.precision(), 0.99);
  EXPECT_LE(figures.centre_rms(), GetParam().centre_rms);
  EXPECT_LE(std::abs(figures.radius_bias()), GetParam().radius_bias);
}

INSTANTIATE_TEST_SUITE_P(Recipes, RandomScenes,
                         ::testing::Values(Bar{"clean", 0.015, 0.01}, Bar{"uneven", 0.03, 0.01},
                                           Bar{"touching", 0.03, 0.01}, Bar{"elliptic", 0.03, 0.01},
                                           Bar{"small", 0.05, 0.03}, Bar{"large", 0.03, 0.01},
                                           Bar{"hard", 0.1, 0.02}, Bar{"glare", 0.05, 0.02}),
                         [](const auto& one) { return std::string{one.param.recipe}; });

Scene plain() {
  Scene scene;
  scene.width = 400;
  scene.height = 300;
  return scene;
}

TEST(Droplets, NothingIsFoundWhereThereIsNothing) {
  for (const double clutter : {0.0, 4.0})
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      Scene scene = plain();
      scene.clutter = clutter;
      scene.light_slope_x = 0.6;
      scene.seed = seed;
      const Droplets found = measure_droplets(render(scene));
      EXPECT_EQ(found.sound(), 0U) << "seed " << seed << ", clutter " << clutter;
    }
  EXPECT_TRUE(measure_droplets(cv::Mat1b(100, 100, 127)).droplets.empty());
}

TEST(Droplets, OneDropIsFoundToAHundredthOfAPixelWhereverItLies) {
  std::mt19937_64 random{3};
  std::uniform_real_distribution<double> unit{0.0, 1.0};
  double square = 0.0;
  constexpr int trials = 30;
  for (int i = 0; i < trials; ++i) {
    Scene scene = plain();
    scene.seed = static_cast<std::uint64_t>(i);
    const double radius = 12.0 + 30.0 * unit(random);
    scene.discs.push_back(
        {.x = 60.0 + 280.0 * unit(random), .y = 60.0 + 180.0 * unit(random), .radius = radius});
    const Droplets found = measure_droplets(render(scene));
    ASSERT_EQ(found.sound(), 1U) << "trial " << i;
    const Droplet& drop = found.droplets.front();
    square += (std::pow(drop.x - scene.discs[0].x, 2) + std::pow(drop.y - scene.discs[0].y, 2)) / trials;
    EXPECT_NEAR(drop.radius, radius, 0.03) << "trial " << i;
    EXPECT_GT(drop.circularity, 0.995);
    EXPECT_GT(drop.score, 0.9);
  }
  EXPECT_LT(std::sqrt(square), 0.015) << "seed 3";
}

TEST(Droplets, InvertingTheImageChangesPolarityAndNothingElse) {
  Scene scene = plain();
  scene.discs = {{.x = 100.3, .y = 99.8, .radius = 25.0}, {.x = 250.1, .y = 180.6, .radius = 26.0}};
  const cv::Mat light = render(scene);
  const Droplets a = measure_droplets(light), b = measure_droplets(255 - light);
  ASSERT_EQ(a.sound(), 2U);
  ASSERT_EQ(b.sound(), 2U);
  EXPECT_EQ(a.polarity, 1);
  EXPECT_EQ(b.polarity, -1);
  for (const Droplet& one : a.droplets) {
    const auto same = std::find_if(b.droplets.begin(), b.droplets.end(),
                                   [&](const Droplet& d) { return std::abs(d.x - one.x) < 5.0; });
    ASSERT_NE(same, b.droplets.end());
    EXPECT_NEAR(same->x, one.x, 1e-3);
    EXPECT_NEAR(same->radius, one.radius, 1e-3);
  }
}

TEST(Droplets, ADropThatIsNotRoundHasTheRadiusOfEqualAreaAndItsAxisRatio) {
  Scene scene = plain();
  scene.discs = {{.x = 200.0, .y = 150.0, .radius = 30.0, .axis_ratio = 0.8, .angle = 0.7}};
  const Droplets found = measure_droplets(render(scene));
  ASSERT_EQ(found.sound(), 1U);
  const Droplet& drop = found.droplets.front();
  EXPECT_NEAR(drop.radius, 30.0, 0.1);
  EXPECT_NEAR(drop.outline.axis_ratio(), 0.8, 0.02);
  // An ellipse of 0.8: perimeter by Ramanujan's formula.
  const double a = 30.0 / std::sqrt(0.8), b = 30.0 * std::sqrt(0.8), h = std::pow((a - b) / (a + b), 2);
  const double perimeter = std::numbers::pi * (a + b) * (1.0 + 3.0 * h / (10.0 + std::sqrt(4.0 - 3.0 * h)));
  EXPECT_NEAR(drop.circularity, 4.0 * std::numbers::pi * std::numbers::pi * 900.0 / (perimeter * perimeter),
              0.01);
}

TEST(Droplets, SatellitesAndCutDropsAreMarkedAndComeLast) {
  Scene scene = plain();
  scene.discs = {{.x = 100.0, .y = 100.0, .radius = 25.0},
                 {.x = 200.0, .y = 200.0, .radius = 25.0},
                 {.x = 395.0, .y = 150.0, .radius = 25.0},
                 {.x = 300.0, .y = 80.0, .radius = 7.0}};
  const Droplets found = measure_droplets(render(scene));
  ASSERT_EQ(found.droplets.size(), 4U);
  EXPECT_EQ(found.sound(), 2U);
  EXPECT_EQ(found.droplets[0].status, DropletStatus::ok);
  EXPECT_EQ(found.droplets[1].status, DropletStatus::ok);
  const auto count = [&](DropletStatus status) {
    return std::count_if(found.droplets.begin(), found.droplets.end(),
                         [&](const Droplet& d) { return d.status == status; });
  };
  EXPECT_EQ(count(DropletStatus::satellite), 1);
  EXPECT_EQ(count(DropletStatus::cut), 1);
}

TEST(Droplets, ColourAndSixteenBitImagesBecomeGrey) {
  Scene scene = plain();
  scene.discs = {{.x = 100.0, .y = 100.0, .radius = 25.0}};
  const cv::Mat image = render(scene);
  cv::Mat colour, wide;
  cv::cvtColor(image, colour, cv::COLOR_GRAY2BGR);
  image.convertTo(wide, CV_16U, 200.0);
  for (const cv::Mat& other : {gray(colour), gray(wide)}) {
    const Droplets found = measure_droplets(other);
    ASSERT_EQ(found.sound(), 1U);
    EXPECT_NEAR(found.droplets[0].x, 100.0, 0.03);
  }
}

}  // namespace
}  // namespace invar::vision
