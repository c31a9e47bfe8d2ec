// Images in each format that is read.
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/vision/image_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace invar::fuzz {

namespace {

Bytes encoded(const std::string& ending, const cv::Mat& picture) {
  std::vector<unsigned char> bytes;
  cv::imencode(ending, picture, bytes);
  return bytes;
}

}  // namespace

std::vector<Target> image_targets() {
  cv::Mat picture(48, 64, CV_8UC1, cv::Scalar{200});
  cv::circle(picture, {30, 24}, 12, cv::Scalar{40}, cv::FILLED);
  cv::Mat deep, colour;
  picture.convertTo(deep, CV_16UC1, 256.0);
  cv::cvtColor(picture, colour, cv::COLOR_GRAY2BGR);
  const auto read = [](const Bytes&, const std::filesystem::path& file) {
    (void)vision::read_gray_image(file);
  };
  std::vector<Target> all;
  for (const char* ending : {".png", ".jpg", ".tiff", ".bmp", ".pgm"}) {
    const bool has_depth = std::string{ending} == ".png" || std::string{ending} == ".tiff";
    std::vector<Bytes> seeds{encoded(ending, picture)};
    if (std::string{ending} != ".pgm") seeds.push_back(encoded(ending, colour));
    if (has_depth) seeds.push_back(encoded(ending, deep));
    all.push_back(
        {std::string{"image_"} + (ending + 1), ending, std::move(seeds), {"IHDR", "IDAT", "\xff\xc0"}, read});
  }
  return all;
}

}  // namespace invar::fuzz
