#include "components/thermal/thermal.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace invar::thermal {

namespace {

metrology::Thermistor equation_of(const Thermal::Thermistor& parameters) {
  return {parameters.resistance, parameters.base_temperature, parameters.coefficient_percent};
}

}  // namespace

Thermal::Thermal(const Parameters& parameters)
    : parameters_{parameters}, thermistor_{equation_of(parameters.thermistor)} {
  const auto map =
      modbus::load_map_of(parameters.modbus.map, "modbus.map", "heater",
                          {"power", "enable", "slide_resistance", "delivered_power", "comm_lost"});
  for (const Zone& zone : parameters.zones) {
    if (!map.find(zone.name + "_resistance"))
      throw InputError{"zones", "the map has no register `" + zone.name + "_resistance`",
                       "name the zone as its register does"};
    zones_.push_back({zone.name + "_resistance", equation_of(zone.thermistor),
                      std::make_unique<Output<NodeTemperature>>(*this, "temperature_" + zone.name, "state"),
                      0.0});
  }
}

void Thermal::configure() { client_.open(parameters_.modbus, simulated_time); }

void Thermal::cleanup() noexcept { client_.close(); }

void Thermal::activate() {
  setpoint_ = setpoint_parameter_ = parameters_.setpoint;
  integral_ = 0.0;
  power_ = 0.0;
  primed_ = false;
  wanted_ = true;
}

void Thermal::deactivate() noexcept {
  if (!client_.is_open()) return;
  drive(0.0, false);
  client_.send(now());
}

/// Power [W] for this temperature. The integral stops where the output is at its limit and would be driven further.
double Thermal::control(double temperature, double period) noexcept {
  const Pid& pid = parameters_.pid;
  if (!primed_) previous_ = temperature, slope_ = 0.0, primed_ = true;
  const double share = pid.derivative_filter > 0.0 ? -std::expm1(-period / pid.derivative_filter) : 1.0;
  slope_ += share * ((temperature - previous_) / period - slope_);
  previous_ = temperature;
  const double error = setpoint_ - temperature;
  const double wanted = pid.kp * error + pid.ki * (integral_ + error * period) - pid.kd * slope_;
  const double power = std::clamp(wanted, 0.0, parameters_.power_limit);
  if (power == wanted || (wanted - power) * error < 0.0) integral_ += error * period;
  return power;
}

void Thermal::drive(double power, bool enable) noexcept {
  power_ = enable ? power : 0.0;
  // Out of the map's range cannot be: the limit was checked; a refusal would leave the last value and its watchdog.
  (void)client_.device().write("enable", enable ? 1.0 : 0.0);
  (void)client_.device().write("power", power_);
}

void Thermal::step(const Tick& tick) noexcept {
  ThermalCommand command;
  while (command_.take(command)) {
    setpoint_ = command.setpoint();
    wanted_ = command.enabled();
    if (command.reset_latch()) latched_ = false;
  }
  if (parameters_.setpoint != setpoint_parameter_) setpoint_ = setpoint_parameter_ = parameters_.setpoint;
  client_.receive(tick.now);
  client_.device().refresh();

  const modbus::Reading resistance = client_.device().value("slide_resistance");
  const bool sound = !resistance.stale && resistance.value > 1.0;
  if (sound) temperature_ = thermistor_.temperature(resistance.value);
  if (sound && temperature_ > parameters_.over_temperature) latched_ = true;
  const bool enable = sound && wanted_ && !latched_;
  if (!enable) primed_ = false;
  drive(enable ? control(temperature_, tick.period) : 0.0, enable);
  client_.send(tick.now);

  NodeTemperature sample;
  stamp(sample);
  sample.node(id);
  sample.temperature(temperature_);
  sample.setpoint(setpoint_);
  sample.heater_power(power_);
  sample.enabled(enable);
  sample.over_temperature(latched_);
  const modbus::Reading lost = client_.device().value("comm_lost");
  sample.watchdog_tripped(!lost.stale && lost.value != 0.0);
  sample.stale(!sound);
  state_.write(sample);
  for (ZoneSensor& zone : zones_) publish_zone(zone);
}

void Thermal::publish_zone(ZoneSensor& zone) noexcept {
  const modbus::Reading resistance = client_.device().value(zone.resistance);
  const bool sound = !resistance.stale && resistance.value > 1.0;
  if (sound) zone.temperature = zone.thermistor.temperature(resistance.value);
  NodeTemperature sample;
  stamp(sample);
  sample.node(id);
  sample.temperature(zone.temperature);
  sample.stale(!sound);
  zone.output->write(sample);
}

}  // namespace invar::thermal
