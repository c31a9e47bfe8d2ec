// SimulatedCamera: renders what a camera over the stage would see - landed droplets, a ruler on the table.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <vector>

#include "components/vision/frame_camera.hpp"
#include "core/vision/mount.hpp"
#include "core/vision/ruler_file.hpp"
#include "core/vision/scene.hpp"
#include "idl/dispensing.h"
#include "idl/sensing.h"

namespace invar::vision {

/// Sees the substrate where the stage truly is, which may differ from what its encoders say.
class SimulatedCamera final : public FrameCamera {
 public:
  struct Ruler {
    std::filesystem::path file;
    std::vector<double> position{0.0, 0.0};
    void describe(auto& p) {
      p(file, "file", "ruler.yaml, each circle with `at`");
      p(position, "position", "m", "position of the ruler's zero, in machine coordinates");
    }
  };
  struct Parameters {
    CameraParameters camera;
    std::int64_t width = 1200, height = 800;
    double scale = 1.29e-5;
    CameraMount mount;
    Scene look;  // light, blur, noise, dust, lens
    std::optional<Ruler> ruler;
    std::int64_t seed = 4;
    void describe(auto& p) {
      camera.describe(p);
      p(width, "width", 16, 4096, "px");
      p(height, "height", 16, 4096, "px");
      p(scale, "scale", "m", Range{1e-8, 1e-2}, "size of a pixel");
      p(mount, "mount", "where it hangs");
      p(look.background, "background", "1", Range{0.0, 255.0}, "grey level of the substrate");
      p(look.foreground, "foreground", "1", Range{0.0, 255.0}, "grey level of drops");
      p(look.blur, "blur", "1", Range{0.0, 20.0}, "px, standard deviation of the optics' blur");
      p(look.noise, "noise", "1", Range{0.0, 100.0}, "grey levels, standard deviation");
      p(look.light_slope_x, "light_slope_x", "1", Range{-1.0, 1.0}, "share of light, left to right");
      p(look.light_slope_y, "light_slope_y", "1", Range{-1.0, 1.0}, "share of light, top to bottom");
      p(look.vignetting, "vignetting", "1", Range{0.0, 1.0}, "share of light lost in the corners");
      p(look.clutter, "clutter", "1", Range{0.0, 100.0}, "grey levels, blotches of the substrate");
      p(look.distortion, "distortion", "1", Range{-0.2, 0.2}, "radial, at the corner");
      p(dust, "dust", 0, 10'000, "specks in a frame");
      p(ruler, "ruler", "on the table");
      p(seed, "seed", 0, 1'000'000'000, "seed of noise and dust");
    }
    std::int64_t dust = 0;
  };
  explicit SimulatedCamera(const Parameters& parameters);
  void configure() override;
  void activate() override;

 private:
  struct Spot {
    Eigen::Vector2d at;   // m, machine coordinates
    double radius = 0.0;  // m
  };
  bool take_picture(const Tick& tick, std::uint64_t number, Picture& picture) override;
  void watch() override;

  const Parameters& parameters_;
  Input<sensing::ToolPosition> tool_{*this, "tool", {.optional = true}};
  Inbox<dispensing::LandedDroplet> landed_{*this, "landed", {.optional = true, .profile = "event"}, 8192};
  Input<dispensing::SubstrateState> substrate_{*this, "substrate", {.optional = true, .profile = "state"}};
  std::vector<Spot> marks_, drops_;
  std::uint64_t substrate_number_ = 0;
};

}  // namespace invar::vision
