#include "components/vision/v4l_camera.hpp"

#include <chrono>
#include <exception>
#include <opencv2/core/utils/logger.hpp>
#include <stdexcept>

#include "components/vision/droplets.hpp"
#include "core/base/clock.hpp"
#include "core/base/fault.hpp"
#include "core/component/plugin.hpp"

namespace invar::vision {

void V4lCamera::configure() {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  stop();
  if (!device_.open(parameters_.device, is_file() ? cv::CAP_ANY : cv::CAP_V4L2)) {
    if (is_file())
      throw InputError{parameters_.device, "no video can be opened there",
                       "name a device (/dev/video0) or a video file that OpenCV reads"};
    throw InputError{parameters_.device, "no camera of Video4Linux can be opened there",
                     "check the cable, `v4l2-ctl --list-devices`, and that this user may read it"};
  }
  if (parameters_.width > 0) device_.set(cv::CAP_PROP_FRAME_WIDTH, static_cast<double>(parameters_.width));
  if (parameters_.height > 0) device_.set(cv::CAP_PROP_FRAME_HEIGHT, static_cast<double>(parameters_.height));
  device_.set(cv::CAP_PROP_BUFFERSIZE, 1.0);
  newest_ = {};
  taken_ = {};
  lost_ = false;
  stopping_ = false;
  thread_ = std::thread{[this] { read(); }};
}

void V4lCamera::stop() noexcept {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  device_.release();
}

void V4lCamera::read() {
  const double rate = is_file() ? device_.get(cv::CAP_PROP_FPS) : 0.0;
  auto due = std::chrono::steady_clock::now();
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
    {
      const std::lock_guard lock{mutex_};
      if (!good) {
        lost_ = true;
        return;
      }
      newest_.image = image;
      newest_.at = at - Duration::seconds(parameters_.latency);
    }
    if (!(rate > 0.0)) continue;  // a device keeps its own time
    due += std::chrono::nanoseconds{static_cast<std::int64_t>(1e9 / rate)};
    std::this_thread::sleep_until(due);
  }
}

bool V4lCamera::take_picture(const Tick&, std::uint64_t, Picture& picture) {
  const std::lock_guard lock{mutex_};
  // Only what was exposed since the last one was taken.
  if (!newest_.image.empty() && newest_.at > taken_) {
    picture = newest_;
    taken_ = newest_.at;
    return true;
  }
  if (lost_)
    throw std::runtime_error{is_file() ? "the video has ended"
                                       : "the camera gives no more frames: is it still plugged in?"};
  return false;
}

}  // namespace invar::vision

INVAR_PLUGIN(registry) {
  registry.add<invar::vision::V4lCamera>("v4l_camera", "a camera of this PC (Video4Linux)");
}
