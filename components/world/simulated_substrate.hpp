// SimulatedSubstrate: the valve, the flight of each droplet, and what lies on the substrate afterwards.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "idl/dispensing.h"
#include "idl/sensing.h"

namespace invar::world {

/// Each pulse of the valve becomes a droplet that leaves the true tool position of its instant. The droplet lands by the terms of
/// core/physics: valve delay, carry by the stage, pressure, slow loss of speed, air drag, crosswind. The head adds tilt,
/// placement error, scatter and satellites. The volume grows with the on-time beyond the time that the valve needs to open, and
/// with the root of the pressure. Examples: 0.619 mm at 180 us and 9.75 psi, 0.664 mm at 200 us and 10 psi (thesis, table 5.1).
class SimulatedSubstrate final : public Component {
 public:
  struct Parameters {
    std::vector<double> placement{0.0, 0.0};
    double tilt = 0.0;
    double azimuth = 0.0;
    double speed = 2.0;
    double delay = 3e-4;
    double speed_decay = 0.0;
    double pressure_exponent = 0.5;
    double drag_diameter = 0.0;
    std::vector<double> crosswind{0.0, 0.0};
    double scatter = 8e-6;
    double scatter_per_height = 1e-3;
    double satellites = 0.0;
    double diameter = 0.619e-3;
    double diameter_scatter = 8e-6;
    double nominal_pressure = 67.224e3;
    double nominal_pulse = 180e-6;
    double dead_time = 88.6e-6;
    double least_pressure = 1e4;
    std::int64_t seed = 6;
    void describe(auto& p) {
      p(placement, "placement", "m", "[x, y] of the landing from below the nozzle");
      p(tilt, "tilt", "rad", Range{0.0, 0.5}, "tilt of the valve from vertical");
      p(azimuth, "azimuth", "rad", Range{-3.15, 3.15}, "towards which it is tilted, from x");
      p(speed, "speed", "m/s", Range{0.05, 50.0},
        "speed of the droplet at the nozzle, at the nominal pressure");
      p(delay, "delay", "s", Range{0.0, 0.2}, "from pulse to droplet");
      p(speed_decay, "speed_decay", "1/s", Range{0.0, 1.0}, "relative loss of speed per second");
      p(pressure_exponent, "pressure_exponent", "1", Range{0.0, 3.0},
        "exponent of the pressure in the speed");
      p(drag_diameter, "drag_diameter", "m", Range{0.0, 5e-3},
        "diameter of the droplet in the air; 0: no drag");
      p(crosswind, "crosswind", "m/s2", "[x, y] push by moving air");
      p(scatter, "scatter", "m", Range{0.0, 1e-2}, "1 sigma of a landing in x and y, at the nozzle");
      p(scatter_per_height, "scatter_per_height", "1", Range{0.0, 0.1},
        "1 sigma that the height adds, per height");
      p(satellites, "satellites", "1", Range{0.0, 1.0}, "share of droplets that leave one");
      p(diameter, "diameter", "m", Range{1e-6, 1e-2}, "at nominal pressure and pulse");
      p(diameter_scatter, "diameter_scatter", "m", Range{0.0, 1e-3}, "1 sigma");
      p(nominal_pressure, "nominal_pressure", "Pa", Range{1.0, 1e6}, "at which speed and diameter hold");
      p(nominal_pulse, "nominal_pulse", "s", Range{1e-5, 1e-2}, "at which the diameter holds");
      p(dead_time, "dead_time", "s", Range{0.0, 1e-2}, "dead time of a pulse, in which the valve only opens");
      p(least_pressure, "least_pressure", "Pa", Range{0.0, 1e6}, "below which nothing leaves the nozzle");
      p(seed, "seed", 0, 1'000'000'000, "seed of scatter and satellites");
      if constexpr (requires { p.node(); }) {
        if (placement.size() != 2) p.node()["placement"].fault("needs two numbers", "write [x, y]");
        if (crosswind.size() != 2) p.node()["crosswind"].fault("needs two numbers", "write [x, y]");
        if (nominal_pulse <= dead_time)
          p.node()["nominal_pulse"].fault("is not longer than `dead_time`", "lengthen it");
      }
    }
  };
  explicit SimulatedSubstrate(const Parameters& parameters) : parameters_{parameters} {}
  void configure() override;
  void activate() override;
  void step(const Tick& tick) noexcept override;

 private:
  struct Tool {
    std::int64_t time_ns = 0;
    Eigen::Vector2d position = Eigen::Vector2d::Zero();
  };
  void remember(const sensing::ToolPosition& tool) noexcept;
  [[nodiscard]] bool tool_at(std::int64_t time_ns, Eigen::Vector2d& position,
                             Eigen::Vector2d& velocity) const noexcept;
  void fly(const dispensing::ValvePulse& pulse) noexcept;
  void land(const dispensing::ValvePulse& pulse, const Eigen::Vector2d& at, double diameter, double after,
            bool satellite) noexcept;

  const Parameters& parameters_;
  Input<sensing::ToolPosition> tool_{*this, "tool"};
  Input<dispensing::PressureState> pressure_{*this, "pressure", {.profile = "state"}};
  Inbox<dispensing::ValvePulse> pulse_{*this, "pulse", {.profile = "command"}, 1024};
  Inbox<dispensing::SubstrateCommand> command_{*this, "command", {.optional = true, .profile = "command"}};
  Output<dispensing::LandedDroplet> landed_{*this, "landed", "event"};
  Output<dispensing::SubstrateState> state_{*this, "state", "state"};

  std::array<Tool, 512> way_{};  // of the tool, the last half second
  std::size_t remembered_ = 0;
  bool begins_ = false;                          // the first step says what lies there
  std::vector<dispensing::ValvePulse> waiting_;  // the tool is not there yet
  dispensing::SubstrateState sample_;
  Instant begun_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace invar::world
