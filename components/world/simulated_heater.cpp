#include "components/world/simulated_heater.hpp"

#include <utility>

namespace invar::world {

SimulatedHeater::SimulatedHeater(const Parameters& parameters) : parameters_{parameters} {
  const auto map = modbus::load_map_of(parameters.modbus.map, "map", "heater", {});
  if (!parameters.modbus.faults.empty()) (void)modbus::load_faults(parameters.modbus.faults, map);
}

void SimulatedHeater::configure() {
  server_ = modbus::serve(parameters_.modbus);
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
  modbus::Server& registers = *server_;
  // Once a step: what the last one computed becomes visible, what masters wrote since arrives, and a lost master has by now
  // switched the pad off.
  registers.exchange(tick.now);
  if (registers.value("reset_alarms") != 0.0) {
    over_temperature_ = false;
    registers.set("reset_alarms", 0.0);
  }
  if (plant_->temperature(pad) > registers.value("over_temperature_limit")) over_temperature_ = true;
  const bool on = registers.value("enable") != 0.0 && !over_temperature_;
  const double power = on ? registers.value("power") : 0.0;
  const std::array<double, 1> powers{power};
  plant_->step({.powers = powers, .ambient = parameters_.ambient}, tick.period);

  const double slide_reading = plant_->reading(slide) + parameters_.noise * normal_(random_);
  const double base_reading = plant_->reading(base) + parameters_.noise * normal_(random_);
  registers.set("slide_resistance", thermistor_.resistance(slide_reading));
  registers.set("base_resistance", thermistor_.resistance(base_reading));
  registers.set("slide_temperature", slide_reading);
  registers.set("base_temperature", base_reading);
  registers.set("pad_temperature", plant_->reading(pad));
  registers.set("delivered_power", power);
  registers.set("heating", power > 0.0 ? 1.0 : 0.0);
  registers.set("over_temperature", over_temperature_ ? 1.0 : 0.0);
  registers.set("ready", over_temperature_ ? 0.0 : 1.0);
  publish(slide_, slide);
  publish(base_, base);
}

}  // namespace invar::world
