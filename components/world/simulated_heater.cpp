#include "components/world/simulated_heater.hpp"

#include <utility>

#include "core/base/unit.hpp"

namespace invar::world {

const modbus::RegisterContract& SimulatedHeater::registers() {
  using enum modbus::RegisterNeed::Access;
  using enum modbus::RegisterNeed::Need;
  static const modbus::RegisterContract contract{
      {"power", "W or %", read, needed, "setpoint of the pad's power; % of the parameter `rated_power`"},
      {"enable", "flag", read, optional, "lets the pad heat; without it every power does"},
      {"reset_alarms", "flag", read, optional, "clears the latches; the device takes it back"},
      {"over_temperature_limit", "degC", read, optional, "pad temperature that trips the latch"},
      {"slide_resistance", "ohm", read, optional, "thermistor of the slide"},
      {"base_resistance", "ohm", read, optional, "thermistor of the base"},
      {"slide_temperature", "degC", read, optional, "temperature of the slide"},
      {"base_temperature", "degC", read, optional, "temperature of the base"},
      {"pad_temperature", "degC", read, optional, "temperature of the pad"},
      {"delivered_power", "W or %", read, optional, "that flows in fact"},
      {"heating", "flag", read, optional, "current flows"},
      {"over_temperature", "flag", read, optional, "latched until `reset_alarms`"},
      {"ready", "flag", read, optional, "powered up and without alarm"}};
  return contract;
}

SimulatedHeater::SimulatedHeater(const Parameters& parameters)
    : parameters_{parameters}, map_{modbus::load_map_of(parameters.modbus.map, "map", "heater")} {
  modbus::MapCheck check{map_, "map", "heater"};
  check.fits(registers());
  check.finish();
  if (!parameters.modbus.faults.empty()) (void)modbus::load_faults(parameters.modbus.faults, map_);
}

double SimulatedHeater::written(const char* reg, double otherwise) const {
  const auto index = map_.find(reg);
  return index ? server_->value(*index) : otherwise;
}

void SimulatedHeater::show(const char* reg, double value) {
  if (const auto index = map_.find(reg)) server_->set(*index, value);
}

/// W of one SI unit of a register for power, which may count parts of the rated one.
double SimulatedHeater::power_scale(const char* reg) const {
  const auto index = map_.find(reg);
  return index && conversion(map_.registers[*index].unit, "1") ? parameters_.rated_power : 1.0;
}

void SimulatedHeater::configure() {
  server_ = modbus::serve(parameters_.modbus, map_);
  const Parameters& p = parameters_;
  plant_.emplace(
      std::vector<physics::ThermalNode>{
          {p.pad_capacity, 0.0}, {p.slide_capacity, p.slide_loss}, {p.base_capacity, p.base_loss}},
      std::vector<physics::ThermalHeater>{{pad, 1.0}},
      std::vector<physics::ThermalCoupling>{{pad, slide, p.pad_slide}, {slide, base, p.slide_base}},
      std::vector<physics::ThermalTerm>{});
}

void SimulatedHeater::cleanup() noexcept {
  server_.reset();
  plant_.reset();
}

void SimulatedHeater::activate() {
  random_.seed(static_cast<std::uint64_t>(parameters_.seed));
  normal_.reset();
  over_temperature_ = false;
  for (const Node node : {pad, slide, base}) plant_->set_temperature(node, parameters_.ambient);
}

void SimulatedHeater::publish(Output<thermal::NodeTemperature>& output, Node node) noexcept {
  thermal::NodeTemperature sample;
  stamp(sample);
  sample.node(id);
  sample.temperature(plant_->temperature(node));
  output.write(sample);
}

void SimulatedHeater::step(const Tick& tick) noexcept {
  // Once a step: what the last one computed becomes visible, what masters wrote since arrives, and a lost master has by now
  // switched the pad off.
  server_->exchange(tick.now);
  if (written("reset_alarms", 0.0) != 0.0) {
    over_temperature_ = false;
    show("reset_alarms", 0.0);
  }
  if (plant_->temperature(pad) > written("over_temperature_limit", parameters_.over_temperature_limit))
    over_temperature_ = true;
  const bool on = written("enable", 1.0) != 0.0 && !over_temperature_;
  const double asked = written("power", 0.0) * power_scale("power");
  const double power = on && asked > 0.0 ? asked : 0.0;
  const std::array<double, 1> powers{power};
  plant_->step({.powers = powers, .ambient = parameters_.ambient}, tick.period);

  const double slide_reading = plant_->reading(slide) + parameters_.noise * normal_(random_);
  const double base_reading = plant_->reading(base) + parameters_.noise * normal_(random_);
  show("slide_resistance", thermistor_.resistance(slide_reading));
  show("base_resistance", thermistor_.resistance(base_reading));
  show("slide_temperature", slide_reading);
  show("base_temperature", base_reading);
  show("pad_temperature", plant_->reading(pad));
  show("delivered_power", power / power_scale("delivered_power"));
  show("heating", power > 0.0 ? 1.0 : 0.0);
  show("over_temperature", over_temperature_ ? 1.0 : 0.0);
  show("ready", over_temperature_ ? 0.0 : 1.0);
  publish(slide_, slide);
  publish(base_, base);
}

}  // namespace invar::world
