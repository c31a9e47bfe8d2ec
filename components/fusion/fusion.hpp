// Fusion: one position of an axis from all its sensors, in the loop.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/component/staged_model.hpp"
#include "core/metrology/fusion/sensor_fusion.hpp"
#include "core/metrology/fusion/sensor_rest.hpp"
#include "core/metrology/fusion/step_free.hpp"
#include "core/metrology/fusion/weighted_fusion.hpp"
#include "idl/sensing.h"
#include "idl/stage.h"

namespace invar::fusion {

/// Runs the estimator of a model that `invar calibrate fusion` made, also one that it is given while it runs. Without a model
/// it runs the structured observer of the sensors as they are described here. Each sensor has a port `sensor_<name>`, or is
/// the position or velocity of `feedback`. A sensor may have a rate of its own. One that is missing or late is left out after
/// `patience`, one that jumps at once, one that dies or sticks as FusionObserver says. The fused position makes no step
/// meanwhile. Real-time.
class Fusion final : public Component {
 public:
  struct Sensor {
    std::string name;
    std::string quantity = "position";
    std::string from = "port";
    double resolution = 0.0;
    double noise = 0.0;
    double gain = 1.0;
    double gain_sigma = 0.1;
    double largest = 1.0;
    double delay = 0.0;
    double delay_sigma = 5e-4;
    double patience = 0.005;
    void describe(auto& p);
  };
  struct Rest {
    double least_weight = 0.0;
    double after = 1.0;
    double look_again = 10.0;
    void describe(auto& p) {
      p(least_weight, "least_weight", "1", Range{0.0, 0.5}, "a sensor that weighs less rests; 0: none does");
      p(after, "after", "s", Range{1e-3, 1e3}, "weighing less for so long");
      p(look_again, "look_again", "s", Range{1e-2, 1e5}, "all wake again after it at the latest");
    }
  };
  struct Learning {
    double memory = 0.0;
    double most = 0.5;
    double most_intercept = 2e-3;
    void describe(auto& p) {
      p(memory, "memory", "s", Range{0.0, 1e5}, "older errors count less and less; 0: nothing is learnt");
      p(most, "most", "1", Range{0.0, 1.0}, "that a weight moves from the model's");
      p(most_intercept, "most_intercept", "m", Range{0.0, 0.1}, "that the intercept moves");
    }
  };
  struct Parameters {
    std::int64_t axis = 0;
    std::filesystem::path model;
    std::vector<Sensor> sensors;
    double resolution = 1e-6;
    double velocity_gain = 1.0;
    double largest_velocity = 1.0;
    double fade = 0.05;
    double selector = 0.0;
    Rest rest;
    Learning learning;
    void describe(auto& p) {
      p(axis, "axis", 0, 2, "0, 1, 2 for x, y, z");
      p(model, "model", "compensation.yaml of kind fusion; none: the parameters below");
      p(sensors, "sensors", "sensors of the axis; none: encoder and velocity of `feedback`");
      p(resolution, "resolution", "m", Range{0.0, 0.01}, "one count of the encoder; 0: continuous");
      p(velocity_gain, "velocity_gain", "1", Range{1e-3, 1e3}, "reading of the velocity sensor per velocity");
      p(largest_velocity, "largest_velocity", "m/s", Range{1e-6, 100.0},
        "typical largest reading of the velocity sensor");
      p(fade, "fade", "s", Range{1e-4, 10.0}, "a step of the estimate is taken out and fades with this");
      p(selector, "selector", "1", Range{-1e9, 1e9}, "further attribute, where the model's weights have one",
        while_running);
      p(rest, "rest", "sensors that add little are switched off");
      p(learning, "learning", "adaptation of a model's weights while an instrument reads on `reference`");
    }
  };
  explicit Fusion(const Parameters& parameters);
  ~Fusion() override;
  void configure() override;
  void activate() override;
  void cleanup() noexcept override { model_.close(); }
  void step(const Tick& tick) noexcept override;

 private:
  struct Source;
  using Staged = StagedModel<std::unique_ptr<metrology::FusionEstimator>>;
  [[nodiscard]] std::string load(const std::filesystem::path& file, Staged::Model& model) const;
  void use_model() noexcept;
  void write(const metrology::FusedPosition& found, const metrology::FusionSample& sample) noexcept;
  [[nodiscard]] double reference(const Tick& tick) noexcept;
  [[nodiscard]] bool read(Source& source, const Tick& tick, metrology::FusionSample& sample) noexcept;

  const Parameters& parameters_;
  std::vector<Sensor> sensors_;  // positions first
  std::size_t positions_ = 0;
  std::vector<std::unique_ptr<Source>> sources_;
  std::unique_ptr<Input<stage::AxisFeedback>> feedback_;
  Input<sensing::DisplacementReading> reference_{
      *this, "reference", {.optional = true, .profile = "calibration"}};
  Output<sensing::FusedPosition> fused_{*this, "fused"};
  std::unique_ptr<metrology::FusionEstimator> described_;  // by the parameters: where there is no model
  metrology::FusionEstimator* estimator_ = nullptr;
  metrology::SensorRest rest_;
  metrology::StepFree step_free_;
  Staged model_;
  unsigned resting_ = 0;
  double velocity_ = 0.0;  // last fused one [m/s]
  std::uint64_t referred_ = 0;
  bool started_ = false;
};

void Fusion::Sensor::describe(auto& p) {
  p(name, "name", "name of the sensor; its port is `sensor_<name>`");
  p(quantity, "quantity", "position or velocity");
  p(from, "from", "port, or feedback: the drive's own encoder or velocity");
  p(resolution, "resolution", "m", Range{0.0, 0.01}, "one count of a position sensor; 0: continuous");
  p(noise, "noise", "m", Range{0.0, 0.01}, "1 sigma of a continuous position sensor, or of an edge");
  p(gain, "gain", "1", Range{1e-3, 1e3}, "reading of a velocity sensor per velocity");
  p(gain_sigma, "gain_sigma", "1", Range{0.0, 1.0},
    "how well that is known, relative; the rest is estimated");
  p(largest, "largest", "m/s", Range{1e-6, 100.0}, "typical largest reading of a velocity sensor");
  p(delay, "delay", "s", Range{0.0, 0.1}, "how late it reads");
  p(delay_sigma, "delay_sigma", "s", Range{0.0, 0.1}, "how well that is known; the rest is estimated");
  p(patience, "patience", "s", Range{1e-4, 10.0}, "a reading older than this is missing");
  if constexpr (requires { p.node(); }) {
    if (quantity != "position" && quantity != "velocity")
      p.node()["quantity"].fault("`" + quantity + "` is not fused", "use position or velocity");
    if (from != "port" && from != "feedback")
      p.node()["from"].fault("`" + from + "` is no source", "use port or feedback");
    if (name.empty()) p.node().fault("the sensor has no name", "write name: encoder");
  }
}

}  // namespace invar::fusion
