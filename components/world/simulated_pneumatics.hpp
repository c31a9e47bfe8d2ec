// SimulatedPneumatics: reservoir, regulator and purge line behind the Modbus registers of a real pressure controller.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <random>
#include <string>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/modbus/contract.hpp"
#include "core/modbus/endpoint.hpp"
#include "idl/dispensing.h"

namespace invar::world {

/// Serves the register map on a TCP port of its own. The regulator follows its setpoint with a lag, as far as the supply
/// reaches. It vents when it is not enabled: by its owner, by the device's own watchdog when the owner is gone, or by the
/// latched over-pressure alarm. The reservoir's true pressure is the port `actual`. Registers that the map lacks are not played.
class SimulatedPneumatics final : public Component {
 public:
  struct Parameters {
    modbus::ServedEndpoint modbus{.map = {}, .port = 1503, .faults = {}};
    double supply = 6e5;
    double lag = 0.15;
    double over_pressure = 3e5;
    double noise = 20.0;
    double leak_through = 0.0;
    bool sensor_fault = false;
    double band = 500.0;
    std::int64_t seed = 5;
    void describe(auto& p) {
      modbus.describe(p);
      p(supply, "supply", "Pa", Range{0.0, 1.6e6}, "compressed air before the regulator", while_running);
      p(lag, "lag", "s", Range{1e-3, 60.0}, "time constant of reservoir and purge line");
      p(over_pressure, "over_pressure", "Pa", Range{1e3, 1.6e6},
        "pressure of the reservoir above which it latches and vents");
      p(noise, "noise", "Pa", Range{0.0, 1e4}, "1 sigma of the pressure sensors");
      p(leak_through, "leak_through", "Pa", Range{0.0, 1.6e6},
        "error of a worn regulator, added to its setpoint", while_running);
      p(sensor_fault, "sensor_fault", "a pressure sensor says that it is broken");
      p(band, "band", "Pa", Range{0.0, 1e5}, "half width for `in_band`, for a map without a register `band`");
      p(seed, "seed", 0, 1'000'000'000, "seed of the noise");
    }
  };
  /// Registers that its map must and may hold.
  static const modbus::RegisterContract& registers();
  explicit SimulatedPneumatics(const Parameters& parameters);
  [[nodiscard]] std::vector<Claim> claims() const override {
    return {{"the port " + parameters_.modbus.host + ":" + std::to_string(parameters_.modbus.port), "port",
             true}};
  }
  void configure() override;
  void cleanup() noexcept override;
  void activate() override;
  void step(const Tick& tick) noexcept override;

 private:
  /// Value that masters wrote to the register, or `otherwise` where the map has none.
  [[nodiscard]] double written(const char* reg, double otherwise) const;
  void show(const char* reg, double value);

  const Parameters& parameters_;
  modbus::RegisterMap map_;
  Output<dispensing::PressureState> actual_{*this, "actual", "state"};
  std::unique_ptr<modbus::Server> server_;
  double pressure_ = 0.0;
  double purge_pressure_ = 0.0;
  bool over_pressure_ = false;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace invar::world
