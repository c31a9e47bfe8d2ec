// V4lCamera, a plugin: frames of a camera of this PC (Video4Linux), read by a thread of its own so that no step waits.
#include <atomic>
#include <exception>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <thread>

#include "components/vision/droplets.hpp"
#include "components/vision/frame_camera.hpp"
#include "core/base/clock.hpp"
#include "core/base/fault.hpp"
#include "core/component/plugin.hpp"

namespace invar::vision {

class V4lCamera final : public FrameCamera {
 public:
  struct Parameters {
    CameraParameters camera;
    std::string device = "/dev/video0";
    std::int64_t width = 0, height = 0;
    double latency = 0.0;
    void describe(auto& p) {
      camera.describe(p);
      p(device, "device", "of Video4Linux");
      p(width, "width", 0, 4096, "px; 0: what the device has");
      p(height, "height", 0, 4096, "px; 0: what the device has");
      p(latency, "latency", "s", Range{0.0, 1.0},
        "from the middle of the exposure until a frame can be read");
    }
  };
  explicit V4lCamera(const Parameters& parameters)
      : FrameCamera{parameters.camera}, parameters_{parameters} {}
  ~V4lCamera() override { stop(); }

  void configure() override {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    stop();
    if (!device_.open(parameters_.device, cv::CAP_V4L2))
      throw InputError{parameters_.device, "no camera of Video4Linux can be opened there",
                       "check the cable, `v4l2-ctl --list-devices`, and that this user may read it"};
    if (parameters_.width > 0) device_.set(cv::CAP_PROP_FRAME_WIDTH, static_cast<double>(parameters_.width));
    if (parameters_.height > 0)
      device_.set(cv::CAP_PROP_FRAME_HEIGHT, static_cast<double>(parameters_.height));
    device_.set(cv::CAP_PROP_BUFFERSIZE, 1.0);
    stopping_ = false;
    thread_ = std::thread{[this] { read(); }};
  }
  void cleanup() noexcept override { stop(); }

 private:
  void stop() noexcept {
    stopping_ = true;
    if (thread_.joinable()) thread_.join();
    device_.release();
  }

  void read() {
    while (!stopping_) {
      cv::Mat image;
      bool good = false;
      try {
        good = device_.read(image) && !image.empty();
        if (good) image = gray(image);
      } catch (const std::exception&) {
        good = false;
      }
      const Instant at = utc_now();
      const std::lock_guard lock{mutex_};
      if (!good) {
        lost_ = true;
        return;
      }
      newest_.image = image;
      newest_.at = at - Duration::seconds(parameters_.latency);
    }
  }

  bool take_picture(const Tick&, std::uint64_t, Picture& picture) override {
    const std::lock_guard lock{mutex_};
    if (lost_) throw std::runtime_error{"the camera gives no more frames: is it still plugged in?"};
    // Only what was exposed since the last one was taken.
    if (newest_.image.empty() || newest_.at <= taken_) return false;
    picture = newest_;
    taken_ = newest_.at;
    return true;
  }

  const Parameters& parameters_;
  cv::VideoCapture device_;
  std::thread thread_;
  std::atomic<bool> stopping_{true};
  std::mutex mutex_;
  Picture newest_;
  Instant taken_;
  bool lost_ = false;
};

}  // namespace invar::vision

INVAR_PLUGIN(registry) {
  registry.add<invar::vision::V4lCamera>("v4l_camera", "a camera of this PC (Video4Linux)");
}
