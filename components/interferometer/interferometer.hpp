// Interferometer: reads the displacement of the tool along a beam, as a laser does.
#pragma once

#include <array>
#include <cstdint>
#include <random>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "idl/sensing.h"

namespace invar::interferometer {

/// The driver of a displacement laser; here fed by the simulated tool position. `beam` aligns it and zeroes it at the
/// tool's present position; the noise of that zero stays in every reading after it, as with the real instrument.
class Interferometer final : public Component {
 public:
  struct Parameters {
    double noise = 5e-8;
    double resolution = 1e-9;
    std::int64_t seed = 2;
    void describe(auto& p) {
      p(noise, "noise", "m", Range{0.0, 1e-4}, "1 sigma of a reading");
      p(resolution, "resolution", "m", Range{0.0, 1e-5}, "one count; 0: none");
      p(seed, "seed", 0, 1'000'000'000, "seed of the noise");
    }
  };
  explicit Interferometer(const Parameters& parameters) : parameters_{parameters} {}
  void activate() override;
  void step(const Tick& tick) noexcept override;

 private:
  [[nodiscard]] double length(const sensing::ToolPosition& tool) noexcept;

  const Parameters& parameters_;
  Input<sensing::ToolPosition> tool_{*this, "tool"};
  Inbox<sensing::BeamCommand> beam_{*this, "beam"};
  Output<sensing::DisplacementReading> reading_{*this, "reading", "calibration"};
  std::array<double, 3> direction_{1.0, 0.0, 0.0};
  std::array<double, 3> start_{};
  double zero_ = 0.0;
  bool zeroed_ = false;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace invar::interferometer
