// SimulatedHeater: pad, slide and base as heat nodes behind the Modbus registers of a real heater controller.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/metrology/thermal/thermistor.hpp"
#include "core/modbus/contract.hpp"
#include "core/modbus/endpoint.hpp"
#include "core/physics/thermal_plant.hpp"
#include "idl/thermal.h"

namespace invar::world {

/// Serves the register map on a TCP port of its own; the device's watchdog and over-temperature latch are part of it, so that
/// a dead master finds the heater off. Registers that the map lacks are not played; those that it has beyond the contract keep
/// their initial value.
class SimulatedHeater final : public Component {
 public:
  struct Parameters {
    modbus::ServedEndpoint modbus;
    double ambient = 23.0;
    double pad_capacity = 60.0;
    double slide_capacity = 850.0;
    double base_capacity = 6000.0;
    double pad_slide = 4.0;
    double slide_base = 3.0;
    double slide_loss = 1.0;
    double base_loss = 8.0;
    double noise = 0.003;
    double rated_power = 200.0;
    double over_temperature_limit = 80.0;
    std::int64_t seed = 3;
    void describe(auto& p) {
      modbus.describe(p);
      p(ambient, "ambient", "degC", Range{-50.0, 100.0}, "temperature of the room", while_running);
      p(pad_capacity, "pad_capacity", "J/K", Range{0.1, 1e6}, "heat capacity of the pad");
      p(slide_capacity, "slide_capacity", "J/K", Range{0.1, 1e6}, "heat capacity of the slide");
      p(base_capacity, "base_capacity", "J/K", Range{0.1, 1e7}, "heat capacity of the base");
      p(pad_slide, "pad_slide", "W/K", Range{0.0, 1e4}, "conductance pad to slide");
      p(slide_base, "slide_base", "W/K", Range{0.0, 1e4}, "conductance slide to base");
      p(slide_loss, "slide_loss", "W/K", Range{0.0, 1e4}, "slide to the air");
      p(base_loss, "base_loss", "W/K", Range{0.0, 1e4}, "base to the air");
      p(noise, "noise", "K", Range{0.0, 1.0}, "1 sigma of the thermistors");
      p(rated_power, "rated_power", "W", Range{0.0, 1e5}, "at 100 %, for a map whose power is in %");
      p(over_temperature_limit, "over_temperature_limit", "degC", Range{0.0, 1000.0},
        "rated power of the pad, for a map without a register for it");
      p(seed, "seed", 0, 1'000'000'000, "seed of the noise");
    }
  };
  /// Registers that its map must and may hold.
  static const modbus::RegisterContract& registers();
  explicit SimulatedHeater(const Parameters& parameters);
  [[nodiscard]] std::vector<Claim> claims() const override {
    return {{"the port " + parameters_.modbus.host + ":" + std::to_string(parameters_.modbus.port), "port",
             true}};
  }
  void configure() override;
  void cleanup() noexcept override;
  void activate() override;
  void step(const Tick& tick) noexcept override;

 private:
  enum Node : std::size_t { pad, slide, base };
  void publish(Output<thermal::NodeTemperature>& output, Node node) noexcept;
  /// Value that masters wrote to the register, or `otherwise` where the map has none.
  [[nodiscard]] double written(const char* reg, double otherwise) const;
  void show(const char* reg, double value);
  [[nodiscard]] double power_scale(const char* reg) const;

  const Parameters& parameters_;
  modbus::RegisterMap map_;
  // The truth: for the simulated stage and for tests, for no controller.
  Output<thermal::NodeTemperature> slide_{*this, "slide", "state"};
  Output<thermal::NodeTemperature> base_{*this, "base", "state"};
  metrology::Thermistor thermistor_;
  std::unique_ptr<modbus::Server> server_;
  std::optional<physics::ThermalPlant> plant_;
  bool over_temperature_ = false;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace invar::world
