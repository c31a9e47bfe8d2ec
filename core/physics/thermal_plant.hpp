// ThermalPlant: lumped heat nodes that step in time, C dT/dt = heaters - losses - couplings and the given
// terms.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/physics/curve.hpp"
#include "core/physics/thermal_hooks.hpp"

namespace invar::physics {

struct ThermalNode {
  double capacity = 1.0;  // [J/K]
  double loss = 0.0;      // [W/K] to the air
};
struct ThermalHeater {
  std::size_t node = 0;
  double gain = 1.0;  // [W/W]
};
struct ThermalCoupling {
  std::size_t first = 0, second = 0;
  double conductance = 0.0;  // [W/K]
};

/// A term with its numbers, in the order of its info, and the node (and the other one, for a coupling) it
/// acts on.
struct ThermalTerm {
  const ThermalTermKind* kind = nullptr;
  std::array<double, most_parameters> parameters{};
  std::size_t node = 0;
  std::size_t other = 0;
  Curve curve{};          // only of an `unmodelled` term
  bool by_power = false;  // the curve is of what its node's heaters give [W/W]
};

/// Inputs of the nodes during one step.
struct ThermalInputs {
  std::span<const double> powers;  // [W] a heater
  double ambient = 20.0;           // [degC]
  double speed = 0.0;              // [m/s] of the stage, for terms that ask for it
  double motor_current = 0.0;      // [A]
};

/// The truth side of heater, slide and base: `world` steps one, `simulate` one for each recording. A term
/// `unmodelled` at site `loss` is a loss [W/K] added over its variable, at `exchange` a conductance [W/K] to the other node.
/// At `storage` it is a capacity [J/K], elsewhere a heat [W] or, by power, a share of the heat of the node's heaters. Classical Runge-Kutta in sub-steps short against the fastest node; sensor lags exactly for a straight temperature.
/// Repeatable bit for bit.
class ThermalPlant {
 public:
  static constexpr std::size_t most_nodes = 16;

  /// Set-up only: allocates. Preconditions: at most 16 nodes and hidden stores together, positive capacities.
  ThermalPlant(std::vector<ThermalNode> nodes, std::vector<ThermalHeater> heaters,
               std::vector<ThermalCoupling> couplings, std::vector<ThermalTerm> terms);

  /// The node, its hidden store and its sensor at this temperature [degC]. Real-time.
  void set_temperature(std::size_t node, double temperature) noexcept;
  void set_time(double time) noexcept { time_ = time; }
  /// Advances by dt [s] with the inputs held. Real-time: no allocation, no lock. `powers` has one entry a
  /// heater.
  void step(const ThermalInputs& inputs, double dt) noexcept;

  [[nodiscard]] std::size_t nodes() const noexcept { return nodes_.size(); }
  [[nodiscard]] double time() const noexcept { return time_; }
  [[nodiscard]] double temperature(std::size_t node) const noexcept { return state_[node]; }  // the truth
  /// Reading of the node's sensor, without noise.
  [[nodiscard]] double reading(std::size_t node) const noexcept {
    return has_lag_[node] ? sensor_[node] : state_[node];
  }

 private:
  using State = std::array<double, most_nodes>;
  [[nodiscard]] State slope(const State& state, double time, const ThermalInputs& inputs) const noexcept;

  std::vector<ThermalNode> nodes_;
  std::vector<ThermalHeater> heaters_;
  std::vector<ThermalCoupling> couplings_;
  std::vector<ThermalTerm> terms_;
  std::vector<const ThermalTerm*> hidden_;  // its state stands behind those of the nodes
  double longest_substep_ = 1e9;
  State state_{}, sensor_{}, lag_{};
  std::array<bool, most_nodes> has_lag_{};
  double time_ = 0.0;

 public:
  // hidden_ points into terms_, which a move carries along and a copy would not.
  ThermalPlant(const ThermalPlant&) = delete;
  ThermalPlant& operator=(const ThermalPlant&) = delete;
  ThermalPlant(ThermalPlant&&) noexcept = default;
  ThermalPlant& operator=(ThermalPlant&&) noexcept = default;
  ~ThermalPlant() = default;
};

}  // namespace invar::physics
