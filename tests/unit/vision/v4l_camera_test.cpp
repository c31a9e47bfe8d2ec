// The camera of a device, by a recorded video in its place.
#include "components/vision/v4l_camera.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <opencv2/videoio.hpp>

#include "core/base/clock.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::vision {
namespace {

using ::testing::HasSubstr;

struct Looker final : Component {
  Inbox<image::Frame> frame{*this, "frame", {.profile = "image"}};
  void step(const Tick&) noexcept override {}
};

TEST(V4lCamera, ShowsEveryFrameOfAVideoInOrderAndSaysThatItHasEnded) {
  const invar::testing::TemporaryFolder folder;
  V4lCamera::Parameters parameters;
  parameters.device = (folder / "take.avi").string();
  parameters.camera.rate = 1000.0;
  parameters.latency = 0.02;
  {
    cv::VideoWriter writer{parameters.device, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10.0, {64, 48}};
    ASSERT_TRUE(writer.isOpened());
    for (int grey = 20; grey <= 200; grey += 30)
      writer.write(cv::Mat{48, 64, CV_8UC3, cv::Scalar::all(grey)});
  }
  V4lCamera camera{parameters};
  Looker looker;
  ASSERT_TRUE(static_cast<OutputPort*>(camera.find_port("frame"))->connect(looker.frame));
  camera.configure();
  camera.activate();
  std::vector<int> greys;
  Instant before;
  const Instant watchdog = utc_now() + Duration::seconds(60.0);
  for (std::uint64_t cycle = 0; camera.failure() == nullptr && utc_now() < watchdog; ++cycle) {
    const Instant now = utc_now();
    camera.set_now(now, cycle);
    camera.step({now, 1e-3, cycle});
    for (image::Frame frame; looker.frame.take(frame);) {
      EXPECT_EQ(frame.width(), 64U);
      EXPECT_EQ(frame.height(), 48U);
      const Instant at{frame.at().time_ns()};
      EXPECT_GT(at, before);
      EXPECT_GE(now - at, Duration::seconds(0.02)) << "exposed `latency` before it could be read";
      before = at;
      greys.push_back(frame.pixels().at(0));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{2});
  }
  ASSERT_NE(camera.failure(), nullptr);
  EXPECT_THAT(camera.failure(), HasSubstr("the video has ended"));
  // A loaded host may miss one; what it shows is in order, to JPEG's rounding.
  ASSERT_GE(greys.size(), 3U);
  EXPECT_THAT(greys, ::testing::WhenSorted(::testing::ElementsAreArray(greys)));
  for (const int grey : greys) EXPECT_LE(std::min((grey + 10) % 30, 30 - (grey + 10) % 30), 2) << grey;
  camera.cleanup();
  camera.configure();  // once more from the start
  camera.cleanup();
}

TEST(V4lCamera, SaysThatAFileIsNoVideo) {
  const invar::testing::TemporaryFolder folder;
  V4lCamera::Parameters parameters;
  V4lCamera camera{parameters};
  parameters.device = folder.write("take.avi", "no video");
  EXPECT_THAT(invar::testing::fault_of([&] { camera.configure(); }),
              HasSubstr("no video can be opened there"));
}

}  // namespace
}  // namespace invar::vision
