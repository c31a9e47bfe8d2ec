// Vision: measures droplets in the newest frame, in machine coordinates; calibrates the camera by a ruler.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/vision/camera.hpp"
#include "core/vision/droplets.hpp"
#include "core/vision/mount.hpp"
#include "core/vision/pixels.hpp"
#include "idl/image.h"

namespace invar::vision {

/// For a worker: a frame of 1200 x 800 takes it 2 to 8 ms. Frames that come faster than it steps are dropped, and counted.
/// A request (`command`) exposes a frame of its own and asks again where that was lost on the way.
class Vision final : public Component {
 public:
  struct Parameters {
    std::filesystem::path camera;
    double distance = 0.0;
    CameraMount mount;
    std::filesystem::path ruler;
    std::string out = "out";
    std::string polarity = "auto";
    double least_diameter = 0.0;
    double largest_diameter = 0.0;
    double patience = 1.0;
    void describe(auto& p) {
      p(camera, "camera", "camera.yaml; without it the camera is calibrated by a ruler first");
      p(distance, "distance", "m", Range{0.0, 1000.0},
        "distance of the substrate straight below a pinhole camera; 0: camera.yaml has the plane");
      p(mount, "mount", "where the camera hangs");
      p(ruler, "ruler", "ruler.yaml: radii of the ruler's circles");
      p(out, "out", "folder for the camera.yaml of a calibration; relative to where the cell was started");
      if constexpr (requires { p.node(); }) check_folder(p.node(), "out", out);
      p(polarity, "polarity", "drops are `light`, `dark`, or `auto`: found out frame by frame");
      p(least_diameter, "least_diameter", "m", Range{0.0, 0.1}, "smaller drops are satellites; 0: found out",
        while_running);
      p(largest_diameter, "largest_diameter", "m", Range{0.0, 0.1}, "larger things are no drops; 0: none is",
        while_running);
      p(patience, "patience", "s", Range{0.01, 60.0}, "waited for a frame before it is asked for again");
    }
  };
  explicit Vision(const Parameters& parameters);
  void configure() override;
  void activate() override;
  void step(const Tick& tick) noexcept override;
  void deactivate() noexcept override;

 private:
  void start(const image::VisionCommand& command);
  void ask();
  void take(const image::Frame& frame);
  void measure(const image::Frame& frame, const PixelsView& picture, bool asked);
  void calibrate(const PixelsView& picture);
  void publish(const image::Frame& frame, const Droplets& found, std::uint64_t request);
  [[nodiscard]] bool wants_picture() const;
  void write_picture(const std::vector<unsigned char>& png) const;
  void report(job::JobPhase phase, const std::string& text);
  [[nodiscard]] Duration since(const image::Frame& frame) const;
  [[nodiscard]] Eigen::Vector2d middle(const PixelsView& picture) const;
  void show_view(int width, int height);

  const Parameters& parameters_;
  Input<image::Frame> frame_{*this, "frame", {.profile = "image"}};
  Inbox<image::VisionCommand> command_{*this, "command", {.optional = true, .profile = "command"}};
  Output<image::ExposeCommand> expose_{*this, "expose", "command"};
  Output<image::DropletsMeasured> droplets_{*this, "droplets", "event"};
  Output<image::VisionStatus> status_{*this, "status", "state"};

  int polarity_ = 0;
  std::vector<double> radii_;          // m, of the ruler's circles
  std::optional<CameraModel> camera_;  // as loaded or calibrated
  std::optional<image::VisionCommand> running_;
  std::optional<std::filesystem::path> picture_;  // to be written for it
  int attempts_ = 0;
  bool reported_ = false;
  Instant asked_;
  image::VisionStatus sample_;
  image::DropletsMeasured measured_;
  std::uint64_t last_number_ = 0;
  std::uint64_t taken_ = 0;  // samples of the input when the newest frame was taken
};

}  // namespace invar::vision
