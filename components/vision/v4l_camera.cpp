#include "components/vision/v4l_camera.hpp"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "core/base/clock.hpp"
#include "core/base/fault.hpp"
#include "core/component/plugin.hpp"

namespace invar::vision {

namespace {

// What is wrong with a device before OpenCV, which does not tell, is asked to open it.
void check(const std::string& device) {
  const int file = ::open(device.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (file < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENODEV || error == ENXIO)
      throw InputError{device, "there is no such device",
                       "plug the camera in; `ls /dev/video*` shows the cameras of this PC"};
    if (error == EACCES || error == EPERM)
      throw InputError{device, "may not be opened by this user",
                       "add the user to the group `video` and log in again"};
    std::array<char, 128> text{};
    throw InputError{device,
                     std::string{"cannot be opened: "} + ::strerror_r(error, text.data(), text.size()),
                     "end what else uses it, or name another device"};
  }
  v4l2_capability found{};
  const bool answers = ::ioctl(file, VIDIOC_QUERYCAP, &found) == 0;
  ::close(file);
  if (!answers)
    throw InputError{device, "is no camera of Video4Linux", "`v4l2-ctl --list-devices` shows which are"};
  const auto can = (found.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? found.device_caps : found.capabilities;
  constexpr auto wanted = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  if ((can & wanted) != wanted) {
    const auto* name = reinterpret_cast<const char*>(found.card);
    throw InputError{device,
                     "takes no pictures: `" + std::string{name, ::strnlen(name, sizeof found.card)} +
                         "` is for something else",
                     "name another device of the same camera (`v4l2-ctl --list-devices`)"};
  }
}

}  // namespace

bool V4lCamera::is_file() const {
  std::error_code ignored;
  return !parameters_.device.starts_with("/dev/") &&
         !std::filesystem::is_character_file(parameters_.device, ignored);
}

void V4lCamera::configure() {
  stop();
  if (!is_file()) check(parameters_.device);
  video_ = open_video({parameters_.device, is_file(), parameters_.width, parameters_.height});
  if (!video_) {
    if (is_file())
      throw InputError{parameters_.device, "no video can be opened there",
                       "name a device (/dev/video0) or a video file that OpenCV reads"};
    throw InputError{parameters_.device, "gives no pictures in a format that is known here",
                     "end the program that uses it; `v4l2-ctl --list-formats` shows its formats"};
  }
  newest_ = {};
  taken_ = {};
  lost_ = false;
  stopping_ = false;
  thread_ = std::thread{[this] { read(); }};
}

void V4lCamera::stop() noexcept {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  video_.reset();
}

void V4lCamera::read() {
  const double rate = is_file() ? video_->rate() : 0.0;
  auto due = std::chrono::steady_clock::now();
  while (!stopping_) {
    Pixels pixels;
    const bool good = video_->read(pixels);
    const Instant at = utc_now();
    {
      const std::lock_guard lock{mutex_};
      if (!good) {
        lost_ = true;
        return;
      }
      newest_.pixels = std::move(pixels);
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
  if (!newest_.pixels.bytes.empty() && newest_.at > taken_) {
    picture = std::move(newest_);
    taken_ = picture.at;
    newest_.pixels.bytes.clear();
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
