// Thermometer: the driver of a temperature sensor on Modbus TCP.
#pragma once

#include <vector>

#include "core/component/component.hpp"
#include "core/component/notices.hpp"
#include "core/component/parameters.hpp"
#include "core/modbus/contract.hpp"
#include "core/modbus/endpoint.hpp"
#include "idl/thermal.h"

/// Publishes the temperature that the device shows. A reading that is old or outside the map's range is marked `stale`. A device
/// that is lost, or well again, is told in a notice. Not real-time (Modbus): for a process with `rate`.
class Thermometer final : public invar::Component {
 public:
  struct Parameters {
    invar::modbus::Endpoint modbus;
    void describe(auto& p) { p(modbus, "modbus", "the sensor"); }
  };

  /// Registers that the map must and may hold; `invar check` and `invar types` follow from this table.
  static const invar::modbus::RegisterContract& registers() {
    using enum invar::modbus::RegisterNeed::Access;
    using enum invar::modbus::RegisterNeed::Need;
    static const invar::modbus::RegisterContract contract{
        {"temperature", "degC", read, needed, "temperature that the sensor measures"},
        {"sensor_fault", "flag", read, optional, "the sensor is open or short"}};
    return contract;
  }

  /// Throws InputError where the map is none of such a sensor.
  explicit Thermometer(const Parameters& parameters)
      : parameters_{parameters},
        map_{invar::modbus::load_map_of(parameters.modbus.map, "modbus.map", "thermometer")} {
    invar::modbus::MapCheck check{map_, "modbus.map", "thermometer"};
    check.fits(registers());
    check.finish();
    temperature_ = map_.find("temperature").value();
    sensor_fault_ = map_.find("sensor_fault");
  }

  /// One master a device: `invar check` refuses a second component on it.
  [[nodiscard]] std::vector<Claim> claims() const override {
    return {{parameters_.modbus.device(map_), "modbus", parameters_.modbus.is_on_this_pc()}};
  }

  void configure() override { client_.open(parameters_.modbus, map_, simulated_time); }
  void cleanup() noexcept override { client_.close(); }

  void step(const invar::Tick& tick) noexcept override {
    client_.receive(tick.now);
    for (const auto& change : client_.look(tick.now))
      notices_.say(severity_of(change.level), change.text.c_str());
    const invar::modbus::Reading reading = client_.device().value(temperature_);
    const bool sound = reading.is_sound() && !client_.flag(sensor_fault_);
    if (sound) last_ = reading.value;
    invar::thermal::NodeTemperature sample;
    stamp(sample);
    sample.node(id);
    sample.temperature(last_);
    sample.stale(!sound);
    state_.write(sample);
    client_.send(tick.now);
  }

 private:
  static invar::event::Severity severity_of(invar::modbus::HealthChange::Level level) {
    using Level = invar::modbus::HealthChange::Level;
    if (level == Level::note) return invar::event::SEVERITY_NOTE;
    return level == Level::warning ? invar::event::SEVERITY_WARNING : invar::event::SEVERITY_FAULT;
  }

  const Parameters& parameters_;
  invar::modbus::RegisterMap map_;
  std::size_t temperature_ = 0;
  std::optional<std::size_t> sensor_fault_;
  invar::modbus::Client client_;
  double last_ = std::numeric_limits<double>::quiet_NaN();  // degC
  invar::Output<invar::thermal::NodeTemperature> state_{*this, "state", "state"};
  invar::Notices notices_{*this};
};
