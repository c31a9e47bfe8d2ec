#include "components/vision/folder_camera.hpp"

#include <gmock/gmock.h>

#include <functional>
#include <opencv2/imgcodecs.hpp>

#include "tests/support/fault_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::vision {
namespace {

using ::testing::HasSubstr;

class FolderCameraTest : public ::testing::Test {
 protected:
  void picture(const std::string& name, unsigned char grey) const {
    cv::imwrite(folder / name, cv::Mat1b(40, 60, grey));
  }
  invar::testing::TemporaryFolder folder;
  FolderCamera::Parameters parameters;
  /// The grey of each frame within some steps of 10 ms.
  std::vector<int> run(int steps, std::string* failure = nullptr) {
    FolderCamera camera{parameters};
    struct Looker final : Component {
      Inbox<image::Frame> frame{*this, "frame", {.profile = "image"}};
      void step(const Tick&) noexcept override {}
    } looker;
    static_cast<OutputPort*>(camera.find_port("frame"))->connect(looker.frame);
    camera.configure();
    camera.activate();
    std::vector<int> greys;
    for (int i = 0; i < steps; ++i) {
      camera.step({Instant{i * 10'000'000LL}, 0.01, static_cast<std::uint64_t>(i)});
      for (image::Frame frame; looker.frame.take(frame);) greys.push_back(frame.pixels().at(0));
    }
    if (failure != nullptr && camera.failure() != nullptr) *failure = camera.failure();
    return greys;
  }
};

TEST_F(FolderCameraTest, ShowsPicturesByNameAtItsRate) {
  picture("b.png", 20);
  picture("a.jpg", 10);
  picture("c.png", 30);
  (void)folder.write("notes.txt", "no picture");
  parameters.folder = folder.path();
  parameters.camera.rate = 50.0;
  EXPECT_THAT(run(3), ::testing::ElementsAre(10, 20));
  EXPECT_THAT(run(20), ::testing::ElementsAre(10, 20, 30));
  parameters.again = true;
  EXPECT_THAT(run(7), ::testing::ElementsAre(10, 20, 30, 10));
}

TEST_F(FolderCameraTest, SaysWhatIsWrongWithItsFolder) {
  parameters.folder = folder / "none";
  EXPECT_THAT(invar::testing::fault_of([&] { FolderCamera{parameters}; }), HasSubstr("is no folder"));
  parameters.folder = folder.path();
  EXPECT_THAT(invar::testing::fault_of([&] { FolderCamera{parameters}; }), HasSubstr("holds no picture"));
  picture("a.png", 10);
  (void)folder.write("b.png", "this is no picture");
  parameters.camera.rate = 100.0;
  std::string failure;
  EXPECT_THAT(run(5, &failure), ::testing::ElementsAre(10));
  EXPECT_THAT(failure, HasSubstr("b.png: is no image"));
}

}  // namespace
}  // namespace invar::vision
