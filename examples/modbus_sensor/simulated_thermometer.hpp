// SimulatedThermometer: the same sensor as a device on a TCP port, to try the driver without hardware.
#pragma once

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "core/component/component.hpp"
#include "core/component/parameters.hpp"
#include "core/modbus/endpoint.hpp"

/// Shows a temperature that swings by 5 K about 20 degC.
class SimulatedThermometer final : public invar::Component {
 public:
  struct Parameters {
    invar::modbus::ServedEndpoint modbus;
    double period = 60.0;
    void describe(auto& p) {
      modbus.describe(p);
      p(period, "period", "s", invar::Range{1.0, 1e5}, "of the swing");
    }
  };
  explicit SimulatedThermometer(const Parameters& parameters)
      : parameters_{parameters},
        map_{invar::modbus::load_map_of(parameters.modbus.map, "map", "thermometer")} {}

  [[nodiscard]] std::vector<Claim> claims() const override {
    return {{"the port " + parameters_.modbus.host + ":" + std::to_string(parameters_.modbus.port), "port",
             true}};
  }
  void configure() override { server_ = invar::modbus::serve(parameters_.modbus, map_); }
  void cleanup() noexcept override { server_.reset(); }
  void activate() override { time_ = 0.0; }

  void step(const invar::Tick& tick) noexcept override {
    time_ += tick.period;
    server_->set("temperature", 20.0 + 5.0 * std::sin(2.0 * std::numbers::pi * time_ / parameters_.period));
    server_->exchange(tick.now);
  }

 private:
  const Parameters& parameters_;
  invar::modbus::RegisterMap map_;
  std::unique_ptr<invar::modbus::Server> server_;
  double time_ = 0.0;  // s
};
