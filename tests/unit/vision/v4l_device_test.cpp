// The camera of a device through OpenCV's own Video4Linux code; the driver's part is played by tests/support/v4l_device.
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <thread>

#include "components/vision/v4l_camera.hpp"
#include "core/base/clock.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/support/v4l_device.hpp"

namespace invar::vision {
namespace {

using invar::testing::fault_of;
using support::v4l_device;
using support::V4lDevice;
using ::testing::AllOf;
using ::testing::HasSubstr;

struct Looker final : Component {
  Inbox<image::Frame> frame{*this, "frame", {.profile = "image"}};
  void step(const Tick&) noexcept override {}
};

struct V4lDeviceTest : ::testing::Test {
  V4lCamera::Parameters parameters;
  V4lDeviceTest() {
    parameters.device = V4lDevice::path;
    parameters.camera.rate = 1000.0;
    parameters.width = 64;
    parameters.height = 48;
    v4l_device().captures = true;
    v4l_device().busy = false;
    v4l_device().unplugged_after = -1;
    v4l_device().frames = 0;
  }
  std::string refusal(const std::string& device) {
    parameters.device = device;
    V4lCamera camera{parameters};
    return fault_of([&] { camera.configure(); });
  }
};

TEST_F(V4lDeviceTest, ShowsItsFramesInTheSizeThatIsAskedForAndSaysWhenItIsUnplugged) {
  v4l_device().unplugged_after = 40;
  V4lCamera camera{parameters};
  Looker looker;
  ASSERT_TRUE(static_cast<OutputPort*>(camera.find_port("frame"))->connect(looker.frame));
  camera.configure();
  camera.activate();
  int frames = 0;
  Instant before;
  const Instant watchdog = utc_now() + Duration::seconds(60.0);
  for (std::uint64_t cycle = 0; camera.failure() == nullptr && utc_now() < watchdog; ++cycle) {
    const Instant now = utc_now();
    camera.set_now(now, cycle);
    camera.step({now, 1e-3, cycle});
    for (image::Frame frame; looker.frame.take(frame); ++frames) {
      EXPECT_EQ(frame.width(), 64U);
      EXPECT_EQ(frame.height(), 48U);
      EXPECT_EQ(frame.pixels().size(), 64U * 48U);
      EXPECT_GT(Instant{frame.at().time_ns()}, before);
      before = Instant{frame.at().time_ns()};
      // Luminance 16 + 20 k of 16 .. 235 is grey 255 / 219 * 20 k.
      const double k = frame.pixels().at(1000) / (20.0 * 255.0 / 219.0);
      EXPECT_NEAR(k, std::round(k), 0.06);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  }
  EXPECT_GE(frames, 3);  // a loaded host may miss some
  ASSERT_NE(camera.failure(), nullptr);
  EXPECT_THAT(camera.failure(), HasSubstr("the camera gives no more frames: is it still plugged in?"));
  v4l_device().unplugged_after = -1;  // plugged in again
  camera.cleanup();
  EXPECT_EQ(fault_of([&] { camera.configure(); }), "accepted");
  camera.cleanup();
}

TEST_F(V4lDeviceTest, SaysWhyADeviceIsNoCamera) {
  EXPECT_THAT(refusal("/dev/video-none"),
              AllOf(HasSubstr("/dev/video-none: there is no such device"), HasSubstr("plug the camera in")));
  EXPECT_THAT(refusal("/dev/null"), HasSubstr("/dev/null: is no camera of Video4Linux"));
  v4l_device().captures = false;
  EXPECT_THAT(refusal(V4lDevice::path),
              HasSubstr("takes no pictures: `Simulated camera` is for something else"));
  v4l_device().captures = true;
  v4l_device().busy = true;
  EXPECT_THAT(refusal(V4lDevice::path), HasSubstr("end the program that uses it"));
}

TEST_F(V4lDeviceTest, SaysThatTheUserMayNotOpenIt) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can make a device that others may not open";
  const invar::testing::TemporaryFolder folder;
  const auto node = folder / "video0";
  std::filesystem::permissions(folder / "", std::filesystem::perms{0755});
  if (::mknod(node.c_str(), S_IFCHR | 0600, ::makedev(1, 3)) != 0) GTEST_SKIP() << "no devices here";
  ASSERT_EQ(::seteuid(65534), 0);
  const std::string said = refusal(node.string());
  ASSERT_EQ(::seteuid(0), 0);
  EXPECT_THAT(said, AllOf(HasSubstr("may not be opened by this user"), HasSubstr("group `video`")));
}

}  // namespace
}  // namespace invar::vision
