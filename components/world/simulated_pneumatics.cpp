#include "components/world/simulated_pneumatics.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace invar::world {

const modbus::RegisterContract& SimulatedPneumatics::registers() {
  using enum modbus::RegisterNeed::Access;
  using enum modbus::RegisterNeed::Need;
  static const modbus::RegisterContract contract{
      {"pressure", "Pa", read, needed, "setpoint of the reservoir over ambient"},
      {"enable", "flag", read, optional, "opens the supply; without it every pressure does"},
      {"purge_pressure", "Pa", read, optional, "setpoint of the purge line"},
      {"purge", "flag", read, optional, "opens the purge valve; without it every purge pressure does"},
      {"band", "Pa", read, optional, "half width of the band around the setpoint"},
      {"reset_alarms", "flag", read, optional, "clears the latches; the device takes it back"},
      {"actual_pressure", "Pa", read, optional, "pressure of the reservoir over ambient"},
      {"actual_purge_pressure", "Pa", read, optional, "pressure of the purge line"},
      {"supply_pressure", "Pa", read, optional, "compressed air before the regulator"},
      {"in_band", "flag", read, optional, "enabled, and the reservoir within `band` of the setpoint"},
      {"supply_low", "flag", read, optional, "supply below what the setpoint needs"},
      {"over_pressure", "flag", read, optional, "latched until `reset_alarms`"},
      {"sensor_fault", "flag", read, optional, "a pressure sensor is out of its range"},
      {"ready", "flag", read, optional, "powered up and without alarm"}};
  return contract;
}

SimulatedPneumatics::SimulatedPneumatics(const Parameters& parameters)
    : parameters_{parameters},
      map_{modbus::load_map_of(parameters.modbus.map, "map", "pneumatic controller")} {
  modbus::MapCheck check{map_, "map", "pneumatic controller"};
  check.fits(registers());
  check.finish();
  if (!parameters.modbus.faults.empty()) (void)modbus::load_faults(parameters.modbus.faults, map_);
}

double SimulatedPneumatics::written(const char* reg, double otherwise) const {
  const auto index = map_.find(reg);
  return index ? server_->value(*index) : otherwise;
}

void SimulatedPneumatics::show(const char* reg, double value) {
  if (const auto index = map_.find(reg)) server_->set(*index, value);
}

void SimulatedPneumatics::configure() { server_ = modbus::serve(parameters_.modbus, map_); }

void SimulatedPneumatics::cleanup() noexcept { server_.reset(); }

void SimulatedPneumatics::activate() {
  random_.seed(static_cast<std::uint64_t>(parameters_.seed));
  normal_.reset();
  pressure_ = purge_pressure_ = 0.0;
  over_pressure_ = false;
}

void SimulatedPneumatics::step(const Tick& tick) noexcept {
  // Once a step: what the last one computed becomes visible, what masters wrote since arrives, and a lost master has by
  // now shut the supply.
  server_->exchange(tick.now);
  if (written("reset_alarms", 0.0) != 0.0) {
    over_pressure_ = false;
    show("reset_alarms", 0.0);
  }
  if (pressure_ > parameters_.over_pressure) over_pressure_ = true;
  const double setpoint = written("pressure", 0.0);
  const bool on = written("enable", setpoint > 0.0 ? 1.0 : 0.0) != 0.0 && !over_pressure_;
  const double purge_setpoint = written("purge_pressure", 0.0);
  const bool purging = written("purge", purge_setpoint > 0.0 ? 1.0 : 0.0) != 0.0 && !over_pressure_;
  const double regulated = std::min(setpoint + parameters_.leak_through, parameters_.supply);
  const double share = -std::expm1(-tick.period / parameters_.lag);
  pressure_ += share * ((on ? regulated : 0.0) - pressure_);
  purge_pressure_ +=
      share * ((purging ? std::min(purge_setpoint, parameters_.supply) : 0.0) - purge_pressure_);

  const double reading = pressure_ + parameters_.noise * normal_(random_);
  const bool supply_low = on && parameters_.supply < setpoint;
  show("actual_pressure", reading);
  show("actual_purge_pressure", purge_pressure_ + parameters_.noise * normal_(random_));
  show("supply_pressure", parameters_.supply);
  show("in_band", on && std::abs(reading - setpoint) <= written("band", parameters_.band) ? 1.0 : 0.0);
  show("supply_low", supply_low ? 1.0 : 0.0);
  show("over_pressure", over_pressure_ ? 1.0 : 0.0);
  show("sensor_fault", parameters_.sensor_fault ? 1.0 : 0.0);
  show("ready", over_pressure_ || parameters_.sensor_fault ? 0.0 : 1.0);

  dispensing::PressureState sample;
  stamp(sample);
  sample.node(id);
  sample.pressure(pressure_);
  sample.setpoint(setpoint);
  sample.purge_pressure(purge_pressure_);
  sample.enabled(on);
  sample.purging(purging);
  sample.supply_low(supply_low);
  sample.over_pressure(over_pressure_);
  sample.sensor_fault(parameters_.sensor_fault);
  sample.comm_lost(server_->comm_lost());
  actual_.write(sample);
}

}  // namespace invar::world
