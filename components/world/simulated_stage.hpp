// SimulatedStage: the drives, encoders and the true tool position of a machine that is not there.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "components/world/axis_ends.hpp"
#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/metrology/geometric/machine.hpp"
#include "core/physics/axis_plant.hpp"
#include "idl/index.h"
#include "idl/sensing.h"
#include "idl/stage.h"
#include "idl/thermal.h"

namespace invar::world {

/// Integrates one physics::AxisPlant for each axis of the machine file's chain. The machine's hidden geometric errors (exact
/// transforms) and the heat of slide and base carry the carriages' positions to the tool. Every axis `a`
/// has the ports `motor_a`, `feedback_a` and `index_a`, and `truth_a` for simulated sensors. Its carriage ends at hard stops.
/// The drive is disabled when its command is older than the watchdog, as real drives do.
class SimulatedStage final : public Component {
 public:
  struct Axis {
    std::filesystem::path model;    // docs/reference/model-file.md#plant-axis: the truth, terms included
    double mass = 3.2;              // used where no model is named
    double motor_constant = 12.0;   //
    double viscous_damping = 25.0;  //
    double resolution = 1e-8;
    double noise = 2e-8;
    double velocity_noise = 1e-4;
    double start = 0.0;
    AxisEndsParameters ends;
    std::filesystem::path changed;  // another truth ...
    double change_at = 1e9;         // ... from this time on
    void describe(auto& p);
  };
  struct Parameters {
    std::filesystem::path machine;
    Axis x, y, z;
    double watchdog = 0.02;
    double temperature = 20.0;
    std::int64_t seed = 1;
    void describe(auto& p);
  };

  explicit SimulatedStage(const Parameters& parameters);
  ~SimulatedStage() override;
  void activate() override;
  void step(const Tick& tick) noexcept override;

 private:
  struct Device;
  static void change(Device& device) noexcept;
  void move(Device& device, const Tick& tick, int periods) const noexcept;
  static constexpr int most_missed = 500;  // cycles of a stall that are made up for
  const Parameters& parameters_;
  metrology::Machine machine_;
  Eigen::Matrix3d directions_;
  std::vector<std::unique_ptr<Device>> devices_;
  Eigen::Vector3d moving_ = Eigen::Vector3d::Zero();
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  Input<thermal::NodeTemperature> slide_{*this, "slide", {.optional = true, .profile = "state"}};
  Input<thermal::NodeTemperature> base_{*this, "base", {.optional = true, .profile = "state"}};
  double scale_temperature_ = 0.0;  // follows the slide with the machine's lag
  double slide_temperature_ = 0.0;
  std::optional<Instant> began_;  // when it was active first
  std::optional<Instant> last_;   // when it stepped last
  bool warm_ = false;             // the slide's temperature has arrived
  Output<sensing::ToolPosition> tool_{*this, "tool"};
};

void SimulatedStage::Axis::describe(auto& p) {
  p(model, "model",
    "model.yaml of plant axis that is this axis' truth; replaces mass, motor_constant, damping");
  p(mass, "mass", "kg", Range{0.01, 1e4}, "all that moves");
  p(motor_constant, "motor_constant", "N/A", Range{1e-3, 1e5}, "force per current");
  p(viscous_damping, "viscous_damping", "N s/m", Range{0.0, 1e5}, "force per speed");
  p(resolution, "resolution", "m", Range{0.0, 0.01}, "one count of the encoder; 0: none");
  p(noise, "noise", "m", Range{0.0, 1e-3}, "1 sigma of the encoder");
  p(velocity_noise, "velocity_noise", "m/s", Range{0.0, 1.0}, "1 sigma of the velocity sensor");
  p(start, "start", "m", Range{-10.0, 10.0}, "where the carriage stands at the start");
  p(ends, "ends", "home switch, limit switches, index marks and hard stops");
  p(changed, "changed", "model.yaml that takes the place of `model` at `change_at`: wear, damage, a fault");
  p(change_at, "change_at", "s", Range{0.0, 1e9}, "when, in seconds since the stage was first active",
    while_running);
}

void SimulatedStage::Parameters::describe(auto& p) {
  p(machine, "machine", "machine.yaml with chain, travel and hidden errors");
  p(x, "x", "the X axis");
  p(y, "y", "the Y axis");
  p(z, "z", "the Z axis");
  p(watchdog, "watchdog", "s", Range{1e-3, 10.0}, "the drive switches off when its command is older");
  p(temperature, "temperature", "degC", Range{-50.0, 150.0},
    "temperature of the machine, where `slide` and `base` are not connected", while_running);
  p(seed, "seed", 0, 1'000'000'000, "seed of the noise");
}

}  // namespace invar::world
