// A pinhole camera on a plane: points that it projects come back to where they lie.
#include "core/vision/pinhole_view.hpp"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>

#include "core/vision/camera_file.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::vision {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

metrology::PinholeCamera bent() {
  return {830.0, 834.0, 610.0, 402.0, 0.4, {-0.28, 0.09, 0.0}, {1e-3, -4e-4}};
}

TEST(PinholeView, SeesDistancesOnATiltedPlaneAsTheyAre) {
  const Eigen::Matrix3d turn{Eigen::AngleAxisd{0.35, Vector3d{0.6, -0.8, 0.0}}};
  const Vector3d foot{0.0, 0.0, 0.31};
  PinholeView view{bent(), 0.31, turn.col(2)};
  std::vector<Vector2d> seen, lie;
  for (double x = -0.1; x <= 0.1; x += 0.05)
    for (double y = -0.08; y <= 0.08; y += 0.04) {
      seen.push_back(bent().project(foot + turn * Vector3d{x, y, 0.0}));
      lie.emplace_back(x, y);
    }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const auto back = view.to_pixels(view.to_plane(seen[i]));
    ASSERT_TRUE(back);
    EXPECT_LT((*back - seen[i]).norm(), 1e-7);
    for (std::size_t k = 0; k < i; ++k)
      EXPECT_NEAR((view.to_plane(seen[i]) - view.to_plane(seen[k])).norm(), (lie[i] - lie[k]).norm(), 1e-10);
  }
  // x as the image's x, y down, from the foot of the optical axis.
  EXPECT_LT(view.to_plane(bent().project(foot)).norm(), 1e-12);
  EXPECT_GT(view.to_plane({700.0, 402.0}).x(), 0.0);
  EXPECT_GT(view.to_plane({610.0, 500.0}).y(), 0.0);
}

TEST(CameraFile, KeepsAPinholeCameraWithItsPlane) {
  const invar::testing::TemporaryFolder folder;
  metrology::PinholeCamera sigma{1.0, 1.0, 2.0, 2.0, 0.1, {1e-3, 2e-3, 0.0}, {1e-4, 1e-4}};
  const PinholeView view{bent(), 0.31, Vector3d{0.1, -0.05, 1.0}.normalized()};
  const auto text = camera_yaml(bent(), sigma, "radial_2_tangential", CameraPlane{view, 3e-9});
  EXPECT_EQ(text.find("k3"), std::string::npos);  // not fitted, not there
  const CameraModel read = read_camera(folder.write("camera.yaml", text));
  ASSERT_TRUE(read.pinhole);
  const Vector2d at{200.0, 700.0};
  EXPECT_LT((read.to_metres(at) - (view.scale() * Vector2d{610.0, 402.0} + view.to_plane(at))).norm(), 1e-10);
  EXPECT_LT((*read.to_pixels(read.to_metres(at)) - at).norm(), 1e-6);
  EXPECT_NEAR(read.scale, view.scale(), 1e-15);
  EXPECT_DOUBLE_EQ(read.scale_sigma, 3e-9);
  // The area of a pixel, against a small square of its own.
  const double side = 2.0;
  const Vector2d a = read.to_metres(at - Vector2d{side, side} / 2.0),
                 b = read.to_metres(at + Vector2d{side, -side} / 2.0),
                 c = read.to_metres(at + Vector2d{-side, side} / 2.0);
  const double area = std::abs((b - a).x() * (c - a).y() - (b - a).y() * (c - a).x());
  EXPECT_NEAR(read.local_scale(at), std::sqrt(area) / side, 1e-3 * read.scale);
}

TEST(CameraFile, APinholeCameraNeedsAPlaneOrADistance) {
  const invar::testing::TemporaryFolder folder;
  const auto file = folder.write("camera.yaml", camera_yaml(bent(), {}, "radial_2", std::nullopt));
  EXPECT_THAT([&] { (void)read_camera(file); },
              ::testing::ThrowsMessage<InputError>(::testing::HasSubstr("calibrate with --plane VIEW")));
  EXPECT_NEAR(read_camera(file, 0.5).scale, 0.5 / std::sqrt(830.0 * 834.0), 1e-12);
}

}  // namespace
}  // namespace invar::vision
