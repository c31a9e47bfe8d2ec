#include "core/vision/mat.hpp"

#include "core/base/contract.hpp"

namespace invar::vision {

cv::Mat mat_of(const PixelsView& picture) {
  return {picture.height, picture.width, picture.wide ? CV_16UC1 : CV_8UC1,
          const_cast<std::uint8_t*>(picture.bytes)};  // NOLINT: nothing writes there
}

Pixels pixels_of(const cv::Mat& image) {
  INVAR_EXPECTS(image.type() == CV_8UC1 || image.type() == CV_16UC1, image.type());
  Pixels pixels{image.cols, image.rows, image.depth() == CV_16U, {}};
  const std::size_t row = static_cast<std::size_t>(image.cols) * image.elemSize();
  pixels.bytes.reserve(row * static_cast<std::size_t>(image.rows));
  for (int y = 0; y < image.rows; ++y) {
    const auto* first = image.ptr<std::uint8_t>(y);
    pixels.bytes.insert(pixels.bytes.end(), first, first + row);
  }
  return pixels;
}

}  // namespace invar::vision
