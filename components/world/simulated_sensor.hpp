// SimulatedSensor: one imperfect position or velocity sensor on a simulated axis, with faults on request.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/physics/sensor_plant.hpp"
#include "idl/sensing.h"

namespace invar::world {

/// Reads the true motion of an axis through the physics terms of instruments: latency, gain compression, play, pitch error,
/// bias. Adds uniform noise in parts of its largest reading, as the thesis does, rounds to its resolution, and
/// fails when it is told to. A sensor with an interval of its own is silent between its readings. Real-time.
class SimulatedSensor final : public Component {
 public:
  struct Fault {
    std::string kind = "dead";
    double at = 0.0;
    double duration = 1e9;
    double size = 0.0;
    void describe(auto& p);
  };
  struct Parameters {
    std::string quantity = "position";
    double resolution = 0.0;
    double gain = 1.0;
    double latency = 0.0;
    double gain_droop = 0.0;
    double hysteresis = 0.0;
    double bias = 0.0;
    double bias_drift = 0.0;
    double pitch = 2e-3;
    double pitch_error = 0.0;
    double noise_level = 0.0;
    double largest = 1.0;
    double interval = 0.0;
    std::int64_t seed = 3;
    std::vector<Fault> faults;
    void describe(auto& p);
  };

  explicit SimulatedSensor(const Parameters& parameters);
  void activate() override;
  void step(const Tick& tick) noexcept override;

 private:
  void send(sensing::AxisReading reading, const Tick& tick, double since) noexcept;

  const Parameters& parameters_;
  bool is_position_;
  physics::SensorPlant plant_;
  Input<sensing::AxisReading> truth_{*this, "truth"};
  Output<sensing::AxisReading> reading_{*this, "reading"};
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
  Instant started_;
  Instant last_;
  double next_ = 0.0;  // when the next reading is due, since the start [s]
  double held_ = 0.0;  // what a stuck sensor shows
  bool first_ = true;
  static constexpr std::size_t past_size = 512;
  std::array<sensing::AxisReading, past_size> past_{};  // a ring, for late ones
  std::size_t count_ = 0;
};

void SimulatedSensor::Fault::describe(auto& p) {
  p(kind, "kind",
    "dead (reads 0), stuck, missing (says nothing), jump (by `size`), late (old samples with their old "
    "stamps) or "
    "lagging (old values with fresh stamps)");
  p(at, "at", "s", Range{0.0, 1e9}, "since the start");
  p(duration, "duration", "s", Range{0.0, 1e9}, "how long");
  p(size, "size", "1", Range{-1e3, 1e3},
    "size of a jump [unit of the sensor]; age of late and lagging samples [s]");
  if constexpr (requires { p.node(); })
    if (kind != "dead" && kind != "stuck" && kind != "missing" && kind != "jump" && kind != "late" &&
        kind != "lagging")
      p.node()["kind"].fault("`" + kind + "` is no fault", "use dead, stuck, missing, jump, late or lagging");
}

void SimulatedSensor::Parameters::describe(auto& p) {
  p(quantity, "quantity", "position or velocity");
  p(resolution, "resolution", "1", Range{0.0, 1.0}, "one count [m or m/s]; 0: none");
  p(gain, "gain", "1", Range{1e-3, 1e3}, "reading of a velocity sensor per velocity");
  p(latency, "latency", "s", Range{0.0, 0.05}, "age of what it shows");
  p(gain_droop, "gain_droop", "s/m", Range{0.0, 100.0}, "relative loss per speed");
  p(hysteresis, "hysteresis", "m", Range{0.0, 1e-2}, "the whole gap of its play");
  p(bias, "bias", "1", Range{-10.0, 10.0}, "added to the reading [m or m/s]");
  p(bias_drift, "bias_drift", "1", Range{-1.0, 1.0}, "growth of the bias per second [m/s or m/s2]");
  p(pitch, "pitch", "m", Range{1e-6, 1.0}, "period of the scale");
  p(pitch_error, "pitch_error", "m", Range{0.0, 1e-2}, "error with the period of the scale");
  p(noise_level, "noise_level", "1", Range{0.0, 100.0}, "uniform noise, in parts of `largest`; 0.05: 5 %",
    while_running);
  p(largest, "largest", "1", Range{1e-9, 100.0}, "reading to which the noise level refers [m or m/s]");
  p(interval, "interval", "s", Range{0.0, 10.0}, "between its readings; 0: every period");
  p(seed, "seed", 0, 1'000'000'000, "seed of the noise");
  p(faults, "faults", "when it fails, and how");
  if constexpr (requires { p.node(); })
    if (quantity != "position" && quantity != "velocity")
      p.node()["quantity"].fault("`" + quantity + "` is not measured", "use position or velocity");
}

}  // namespace invar::world
