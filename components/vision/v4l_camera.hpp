// V4lCamera, a plugin: frames of a camera of this PC (Video4Linux), or of a recorded video, read by a thread of its own so that
// no step waits.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "components/vision/frame_camera.hpp"
#include "core/vision/video.hpp"

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
      p(device, "device", "device of Video4Linux, or a video file that OpenCV reads, shown at its own rate");
      p(width, "width", 0, 4096, "px; 0: what the device has");
      p(height, "height", 0, 4096, "px; 0: what the device has");
      p(latency, "latency", "s", Range{0.0, 1.0},
        "from the middle of the exposure until a frame can be read");
    }
  };
  explicit V4lCamera(const Parameters& parameters)
      : FrameCamera{parameters.camera}, parameters_{parameters} {}
  ~V4lCamera() override { stop(); }
  [[nodiscard]] std::vector<Claim> claims() const override {
    return is_file() ? std::vector<Claim>{} : std::vector<Claim>{{parameters_.device, "device", true}};
  }
  void configure() override;
  void cleanup() noexcept override { stop(); }

 private:
  void stop() noexcept;
  void read();
  bool take_picture(const Tick& tick, std::uint64_t number, Picture& picture) override;
  [[nodiscard]] bool is_file() const;

  const Parameters& parameters_;
  std::unique_ptr<Video> video_;
  std::thread thread_;
  std::atomic<bool> stopping_{true};
  std::mutex mutex_;
  Picture newest_;
  Instant taken_;
  bool lost_ = false;
};

}  // namespace invar::vision
