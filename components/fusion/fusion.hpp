// Fusion: one position of an axis from its encoder and its velocity sensor, in the loop.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/metrology/sensor_fusion.hpp"
#include "idl/sensing.h"
#include "idl/stage.h"

namespace invar::fusion {

/// Runs the estimator of a model that `invar calibrate fusion` made (one position sensor, one velocity sensor). Without a
/// model: the structured observer with the encoder's resolution. Real-time.
class Fusion final : public Component {
 public:
  struct Parameters {
    std::filesystem::path model;
    double resolution = 1e-6;
    double velocity_gain = 1.0;
    double largest_velocity = 1.0;
    void describe(auto& p) {
      p(model, "model", "compensation.yaml of kind fusion; none: the parameters below");
      p(resolution, "resolution", "m", Range{0.0, 0.01}, "one count of the encoder; 0: continuous");
      p(velocity_gain, "velocity_gain", "1", Range{1e-3, 1e3}, "reading of the velocity sensor per velocity");
      p(largest_velocity, "largest_velocity", "m/s", Range{1e-6, 100.0},
        "typical largest reading of the velocity sensor");
    }
  };
  explicit Fusion(const Parameters& parameters) : parameters_{parameters} {}
  void configure() override;
  void activate() override;
  void step(const Tick& tick) noexcept override;

 private:
  const Parameters& parameters_;
  Input<stage::AxisFeedback> feedback_{*this, "feedback"};
  Output<sensing::FusedPosition> fused_{*this, "fused"};
  std::unique_ptr<metrology::FusionEstimator> estimator_;
  bool first_ = true;
};

}  // namespace invar::fusion
