// FrameCamera: what every camera component has - when it exposes, where the stage stood, frames with numbers.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/vision/pixels.hpp"
#include "idl/image.h"
#include "idl/stage.h"

namespace invar::vision {

struct CameraParameters {
  double rate = 0.0;
  double exposure = 1e-3;
  std::int64_t axes = 2;
  void describe(auto& p) {
    p(rate, "rate", "Hz", Range{0.0, 1000.0}, "rate of frames; 0: only on request");
    p(exposure, "exposure", "s", Range{1e-7, 10.0}, "time of exposure");
    p(axes, "axes", 1, 3, "how many axes of the stage it looks at: inputs state_x, state_y, state_z");
  }
};

/// For a worker, not for the loop. Derive, and give pictures.
class FrameCamera : public Component {
 public:
  explicit FrameCamera(const CameraParameters& parameters);
  void activate() override;
  void step(const Tick& tick) noexcept final;

 protected:
  struct Picture {
    Pixels pixels;
    Instant at;  // middle of the exposure
  };
  /// Takes a picture that is wanted now; false: there is none. An exception takes the component to error.
  virtual bool take_picture(const Tick& tick, std::uint64_t number, Picture& picture) = 0;
  /// Every step: takes what came.
  virtual void watch() {}

 private:
  using Position = std::array<double, 3>;
  [[nodiscard]] bool is_due(const Tick& tick);
  void follow_stage(const Tick& tick);
  [[nodiscard]] Position position_at(Instant time) const;
  void publish(Picture& picture, std::uint64_t request);

  const CameraParameters& parameters_;
  Inbox<image::ExposeCommand> expose_{*this, "expose", {.optional = true, .profile = "command"}};
  Output<image::Frame> frame_{*this, "frame", "image"};
  std::vector<std::unique_ptr<Input<stage::AxisState>>> axes_;
  std::deque<std::pair<Instant, Position>> history_;
  image::Frame sample_;
  std::uint64_t number_ = 0;
  std::uint64_t request_ = 0;  // not answered yet
  Instant requested_, due_;
  bool free_running_ = false;
  std::string failure_;
};

}  // namespace invar::vision
