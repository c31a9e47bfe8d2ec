// The one function that libinvar_video.so offers: a device or a file read by OpenCV.
#include <exception>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>

#include "core/vision/droplets.hpp"
#include "core/vision/mat.hpp"
#include "core/vision/video.hpp"

namespace {

using namespace invar::vision;

class Capture final : public Video {
 public:
  bool open(const VideoRequest& request) {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    if (!device_.open(request.place, request.is_file ? cv::CAP_ANY : cv::CAP_V4L2)) return false;
    if (request.width > 0) device_.set(cv::CAP_PROP_FRAME_WIDTH, static_cast<double>(request.width));
    if (request.height > 0) device_.set(cv::CAP_PROP_FRAME_HEIGHT, static_cast<double>(request.height));
    device_.set(cv::CAP_PROP_BUFFERSIZE, 1.0);
    return true;
  }
  bool read(Pixels& pixels) override {
    try {
      cv::Mat image;
      if (!device_.read(image) || image.empty()) return false;
      pixels = pixels_of(gray(image));
      return true;
    } catch (const std::exception&) {
      return false;
    }
  }
  [[nodiscard]] double rate() const override { return device_.get(cv::CAP_PROP_FPS); }

 private:
  cv::VideoCapture device_;
};

}  // namespace

extern "C" __attribute__((visibility("default"))) Video* invar_open_video(const VideoRequest& request) {
  auto capture = std::make_unique<Capture>();
  return capture->open(request) ? capture.release() : nullptr;
}
