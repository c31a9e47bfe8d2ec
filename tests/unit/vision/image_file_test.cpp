#include "core/vision/image_file.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "core/vision/camera_file.hpp"
#include "tests/support/fault_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace invar::vision {
namespace {

using ::testing::HasSubstr;

class ImageFile : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream{folder / name, std::ios::binary} << bytes;
    return folder / name;
  }
  static std::string bytes_of(const std::string& extension, int size = 64) {
    cv::Mat1b image(size, size);
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) image(y, x) = static_cast<unsigned char>((x * 37 + y * 91) % 256);
    std::vector<unsigned char> bytes;
    cv::imencode(extension, image, bytes);
    return {bytes.begin(), bytes.end()};
  }
  static std::string fault_of(const std::filesystem::path& file) {
    return invar::testing::fault_of([&] { read_gray_image(file); });
  }
  invar::testing::TemporaryFolder folder;
};

TEST_F(ImageFile, PngJpegAndPgmAreRead) {
  for (const std::string extension : {".png", ".jpg", ".pgm", ".bmp"}) {
    const cv::Mat image = read_gray_image(write("a" + extension, bytes_of(extension)));
    EXPECT_EQ(image.type(), CV_8UC1);
    EXPECT_EQ(image.cols, 64);
  }
}

TEST_F(ImageFile, EachFaultIsSaidWithTheFilesName) {
  const std::string png = bytes_of(".png"), jpeg = bytes_of(".jpg");
  EXPECT_THAT(fault_of(folder / "none.png"), HasSubstr("none.png: no such image file"));
  EXPECT_THAT(fault_of(folder.path()), HasSubstr("is a folder"));
  EXPECT_THAT(fault_of(write("empty.png", "")), HasSubstr("empty.png: the image is empty"));
  EXPECT_THAT(fault_of(write("text.png", "this is no image")), HasSubstr("text.png: is no image"));
  EXPECT_THAT(fault_of(write("cut.png", png.substr(0, png.size() / 2))), HasSubstr("cut.png: "));
  EXPECT_THAT(fault_of(write("cut.jpg", jpeg.substr(0, jpeg.size() / 2))),
              HasSubstr("cut.jpg: the image is truncated"));
  EXPECT_THAT(fault_of(write("tiny.png", bytes_of(".png", 8))), HasSubstr("only 8 x 8 pixels"));
}

TEST_F(ImageFile, AHugePictureIsRefusedByItsHead) {
  const auto with = [&](const std::string& name, std::string bytes, std::size_t at, const std::string& size) {
    bytes.replace(at, size.size(), size);
    return fault_of(write(name, bytes));
  };
  using namespace std::string_literals;
  EXPECT_THAT(with("a.png", bytes_of(".png"), 16, "\0\0\x80\0\0\0\x80\0"s),
              HasSubstr("a.png: says that it has 32768 x 32768 pixels"));
  EXPECT_THAT(with("a.bmp", bytes_of(".bmp"), 18, "\0\0\1\0\0\0\1\0"s), HasSubstr("65536 x 65536 pixels"));
  const std::string jpeg = bytes_of(".jpg");
  EXPECT_THAT(with("a.jpg", jpeg, jpeg.find("\xff\xc0") + 5, "\xff\xff\xff\xff"),
              HasSubstr("65535 x 65535 pixels"));
  EXPECT_THAT(fault_of(write("a.pgm", "P5\n# c\n1000000 1000000\n255\n")),
              HasSubstr("1000000 x 1000000 pixels"));
  EXPECT_THAT(fault_of(write("a.tif",
                             "II*\0\x08\0\0\0\2\0\0\1\4\0\1\0\0\0\0\0\1\0\1\1\4\0\1\0\0\0\0\0\1\0\0\0\0\0"s)),
              HasSubstr("65536 x 65536 pixels"));
  EXPECT_THAT(fault_of(write("a.webp", "RIFF\x20\0\0\0WEBPVP8 "s)),
              HasSubstr("give a PNG, JPEG, TIFF, BMP or PGM file"));
}

TEST_F(ImageFile, ACameraIsReadAsItWasWritten) {
  CameraModel camera;
  camera.width = 1200;
  camera.height = 800;
  camera.scale = 1.041772e-5;
  camera.scale_sigma = 6e-10;
  camera.aspect = 1.001;
  camera.distortion = 1.19e-8;
  camera.center = {599.5, 399.5};
  const auto back = read_camera(write("camera.yaml", camera_yaml(camera)));
  EXPECT_DOUBLE_EQ(back.scale, camera.scale);
  EXPECT_DOUBLE_EQ(back.aspect, camera.aspect);
  EXPECT_DOUBLE_EQ(back.distortion, camera.distortion);
  EXPECT_EQ(back.center, camera.center);
}

TEST_F(ImageFile, ACameraWithoutScaleIsRefused) {
  for (const auto& [text, fault] :
       {std::pair{"scael: 1e-5\n", "scale"}, std::pair{"scale: {value: 1.0e-5, unit: kg}\n", "kg"},
        std::pair{"model: pinhole\n", "pinhole: missing"}}) {
    try {
      (void)read_camera(write("camera.yaml", text));
      ADD_FAILURE() << "accepted: " << text;
    } catch (const InputError& error) {
      EXPECT_THAT(std::string{error.what()}, HasSubstr("camera.yaml")) << text;
      std::string all;
      for (const Fault& one : error.faults()) all += one.line() + "\n";
      EXPECT_THAT(all, HasSubstr(fault)) << text;
    }
  }
}

}  // namespace
}  // namespace invar::vision
