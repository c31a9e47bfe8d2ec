#include "components/vision/observe.hpp"

#include <gmock/gmock.h>

#include "components/vision/render.hpp"

namespace invar::vision {
namespace {

Scene scene_with_two() {
  Scene scene;
  scene.width = 400;
  scene.height = 300;
  scene.discs = {{.x = 100.0, .y = 120.0, .radius = 24.0}, {.x = 300.0, .y = 180.0, .radius = 24.0}};
  return scene;
}

TEST(Observe, AFrameBecomesDropletsInMetres) {
  CameraModel camera;
  camera.scale = 1.29e-5;
  const Observation seen = observe(render(scene_with_two()), camera);
  ASSERT_EQ(seen.observed.size(), 2U);
  for (const ObservedDroplet& drop : seen.observed) {
    const bool first = drop.x < 2e-3;
    EXPECT_NEAR(drop.x, 1.29e-5 * (first ? 100.0 : 300.0), 5e-7);
    EXPECT_NEAR(drop.y, 1.29e-5 * (first ? 120.0 : 180.0), 5e-7);
    EXPECT_NEAR(drop.diameter, 1.29e-5 * 48.0, 1e-6);
    EXPECT_LT(drop.sigma, 5e-7);
  }
}

TEST(Observe, TheAnnotatedFrameIsColouredWhereDropletsAndTargetsAre) {
  CameraModel camera;
  camera.scale = 1e-5;
  const cv::Mat frame = render(scene_with_two());
  const Observation seen = observe(frame, camera);
  const cv::Mat picture = annotate(frame, seen, camera, {{1.05e-3, 1.2e-3}}, 40.0);
  ASSERT_EQ(picture.type(), CV_8UC3);
  ASSERT_EQ(picture.size(), frame.size());
  const auto coloured = [&](int x, int y) {
    const cv::Vec3b p = picture.at<cv::Vec3b>(y, x);
    return p[0] != p[1] || p[1] != p[2];
  };
  EXPECT_TRUE(coloured(100, 96));   // the top of the first outline
  EXPECT_TRUE(coloured(109, 120));  // the target's ring, 4 px about (105, 120)
  EXPECT_FALSE(coloured(200, 20));
}

}  // namespace
}  // namespace invar::vision
