#include "components/thermal/thermal.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace invar::thermal {

namespace {

metrology::Thermistor equation_of(const Thermal::Thermistor& parameters) {
  return {parameters.resistance, parameters.base_temperature, parameters.coefficient_percent};
}

}  // namespace

Thermal::Thermal(const Parameters& parameters)
    : parameters_{parameters}, thermistor_{equation_of(parameters.thermistor)} {
  const auto map = modbus::load_map_of(parameters.modbus.map, "modbus.map", "heater",
                                       {{"power", "W", true},
                                        {"enable", "1", true},
                                        {"slide_resistance", "ohm"},
                                        {"delivered_power", "W"},
                                        {"comm_lost"}});
  modbus::must_take(map, "power", {0.0, parameters.power_limit}, "power_limit");
  device_ = parameters.modbus.device(map);
  if (map.heartbeat) lets_go_ = map.heartbeat->timeout.in_seconds();
  modbus::must_let_go(map, "modbus.map", {"enable", "power"});
  has_fault_bit_ = map.find("sensor_fault").has_value();
  has_latch_bit_ = map.find("over_temperature").has_value();
  has_reset_ = map.find("reset_alarms").has_value();
  if (has_reset_) modbus::must_have(map, "modbus.map", "heater", {"reset_alarms", "1", true});
  for (const Zone& zone : parameters.zones) {
    if (!map.find(zone.name + "_resistance"))
      throw InputError{"zones", "the map has no register `" + zone.name + "_resistance`",
                       "name the zone as its register does"};
    modbus::must_have(map, "modbus.map", "heater", {zone.name + "_resistance", "ohm"});
    zones_.push_back({zone.name + "_resistance", equation_of(zone.thermistor),
                      std::make_unique<Output<NodeTemperature>>(*this, "temperature_" + zone.name, "state"),
                      unknown});
  }
}

std::vector<Component::Claim> Thermal::claims() const {
  return {{device_, "modbus", parameters_.modbus.is_on_this_pc()}};
}

void Thermal::configure() { client_.open(parameters_.modbus, simulated_time); }

void Thermal::cleanup() noexcept { client_.close(); }

void Thermal::activate() {
  setpoint_ = setpoint_parameter_ = parameters_.setpoint;
  integral_ = 0.0;
  power_ = 0.0;
  primed_ = false;
  wanted_ = true;
  told_unsound_ = told_undriven_ = told_stuck_ = false;
  unsound_since_.reset();
  stuck_since_.reset();
}

void Thermal::deactivate() noexcept {
  if (!client_.is_open()) return;
  (void)drive(0.0, false);
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

/// False when the power is none that the register takes: the heater is then off, and does not keep its last power.
bool Thermal::drive(double power, bool enable) noexcept {
  modbus::Device& device = client_.device();
  power_ = enable ? power : 0.0;
  const bool taken = device.write("power", power_).ok();
  if (!taken) {
    power_ = integral_ = 0.0;
    primed_ = false;
    (void)device.write("power", 0.0);  // the map takes it: checked when the component was made
  }
  (void)device.write("enable", enable && taken ? 1.0 : 0.0);
  return taken;
}

void Thermal::obey(const ThermalCommand& command) noexcept {
  const double setpoint = command.setpoint();
  if (Parameters::setpoints.contains(setpoint) && setpoint < parameters_.over_temperature) {
    setpoint_ = setpoint;
    wanted_ = command.enabled();
    if (command.reset_latch()) {
      latched_ = false;
      watch_.reset();
      reset_at_ = now();
      if (has_reset_) (void)client_.device().write("reset_alarms", 1.0);
    }
    return;
  }
  wanted_ = wanted_ && command.enabled();
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(),
                "a command's setpoint of %g degC is refused: it must be a number from %g to %g and below "
                "`over_temperature` of %g degC",
                setpoint, Parameters::setpoints.lower, Parameters::setpoints.upper,
                parameters_.over_temperature);
  notices_.say(event::SEVERITY_WARNING, text.data());
}

/// The temperature [degC] by this register; nothing where it cannot be trusted.
std::optional<double> Thermal::measured(const std::string& reg,
                                        const metrology::Thermistor& thermistor) const noexcept {
  const modbus::Device& device = client_.device();
  const modbus::Reading resistance = device.value(reg);
  if (!resistance.is_sound() || !(resistance.value > 0.0)) return {};
  if (has_fault_bit_ && device.value("sensor_fault").value != 0.0) return {};
  const double temperature = thermistor.temperature(resistance.value);
  return parameters_.measurable.contains(temperature) ? std::optional{temperature} : std::nullopt;
}

/// What the device's health is, and whether its sensor can be.
void Thermal::tell(bool sound, const Tick& tick) noexcept {
  for (const modbus::HealthChange& change : client_.look(tick.now))
    notices_.say(change.well ? event::SEVERITY_NOTE : event::SEVERITY_FAULT, change.text.c_str());
  const modbus::Reading resistance = client_.device().value("slide_resistance");
  // What is stale or outside the map's range was said above.
  const bool impossible = !sound && resistance.is_sound();
  if (!impossible) unsound_since_.reset();
  if (impossible && !unsound_since_) unsound_since_ = tick.now;
  constexpr Duration patience = Duration::milliseconds(500);
  if (impossible && !told_unsound_ && tick.now - *unsound_since_ >= patience) {
    told_unsound_ = true;
    std::array<char, 200> text{};
    std::snprintf(
        text.data(), text.size(),
        "the slide's thermistor at %g ohm is open or short, or the map reads it wrongly: the heater is off",
        resistance.value);
    notices_.say(event::SEVERITY_FAULT, text.data());
  } else if (sound && std::exchange(told_unsound_, false)) {
    notices_.say(event::SEVERITY_NOTE, "the slide's thermistor is sound again");
  }
}

/// Too hot: off until somebody resets it. A device that latched by itself is off, whatever it is told.
void Thermal::latch(bool sound, const Tick& tick) noexcept {
  constexpr Duration grace = Duration::milliseconds(500);  // until a reset shows
  const bool hot = sound && temperature_ > parameters_.over_temperature;
  const bool device = has_latch_bit_ && client_.device().value("over_temperature").value != 0.0 &&
                      !client_.device().value("over_temperature").stale && tick.now - reset_at_ > grace;
  if (!(hot || device) || std::exchange(latched_, true)) return;
  std::array<char, 200> text{};
  if (hot)
    std::snprintf(text.data(), text.size(),
                  "%.4g degC is above `over_temperature`: the heater is off until a command resets the latch",
                  temperature_);
  else
    std::snprintf(text.data(), text.size(),
                  "the controller has switched the heater off at its own limit, the slide at %.4g degC: it "
                  "is off until a "
                  "command resets the latch",
                  temperature_);
  notices_.say(event::SEVERITY_TRIP, text.data());
}

/// A relay that sticks, or another master: the heater is on, and this loop cannot help it.
void Thermal::look_at_delivery(const Tick& tick) noexcept {
  const modbus::Reading delivered = client_.device().value("delivered_power");
  const bool stuck =
      power_ == 0.0 && delivered.is_sound() && delivered.value > 0.01 * parameters_.power_limit;
  if (!stuck) stuck_since_.reset();
  if (stuck && !stuck_since_) stuck_since_ = tick.now;
  constexpr Duration patience = Duration::seconds(2.0);
  if (stuck && !told_stuck_ && tick.now - *stuck_since_ >= patience) {
    told_stuck_ = true;
    std::array<char, 200> text{};
    std::snprintf(
        text.data(), text.size(),
        "the heater gets %.4g W though it was told to be off: cut its supply, and look at its relay and for "
        "another master",
        delivered.value);
    notices_.say(event::SEVERITY_TRIP, text.data());
  } else if (!stuck && delivered.is_sound() && std::exchange(told_stuck_, false)) {
    notices_.say(event::SEVERITY_NOTE, "the heater is off as it was told");
  }
}

HeatWatch::Settings Thermal::watched() const noexcept {
  const Response& response = parameters_.response;
  return {.full = parameters_.power_limit,
          .rise = response.rise,
          .within = response.within,
          .hold = response.hold,
          .leap = response.leap,
          .lets_go = lets_go_};
}

/// Heat that does not show in the temperature, or a temperature that no heat makes: off until somebody resets it.
void Thermal::look_at_response(std::optional<double> reading, const Tick& tick) noexcept {
  using Doubt = HeatWatch::Doubt;
  const double before = watch_.waited();
  const Doubt doubt = watch_.look(watched(), reading, setpoint_, power_, tick.now, tick.period);
  if (doubt == Doubt::none) return;
  watch_.reset();
  if (std::exchange(latched_, true)) return;
  const auto& [rise, within, hold, leap] = parameters_.response;
  std::array<char, 320> text{};
  if (doubt == Doubt::leapt)
    std::snprintf(
        text.data(), text.size(),
        "the slide's reading leapt by more than %.4g K within a second, from %.4g degC: a thermistor that is "
        "loose; the heater is off until a command resets the latch",
        leap, temperature_);
  else
    std::snprintf(
        text.data(), text.size(),
        "the heat of %.4g W for %.4g s, given in %.4g s, has not %s (it reads %.4g degC): a "
        "thermistor that is off or frozen, or a pad that is dead or too weak; the heater is off until a "
        "command resets the latch",
        parameters_.power_limit, within, std::max(before + tick.period, within),
        doubt == Doubt::frozen ? "changed the slide's reading at all" : "warmed the slide as `response` says",
        temperature_);
  notices_.say(event::SEVERITY_TRIP, text.data());
}

void Thermal::step(const Tick& tick) noexcept {
  ThermalCommand command;
  while (command_.take(command)) obey(command);
  if (parameters_.setpoint != setpoint_parameter_) setpoint_ = setpoint_parameter_ = parameters_.setpoint;
  client_.receive(tick.now);
  const auto measured_now = measured("slide_resistance", thermistor_);
  tell(measured_now.has_value(), tick);
  const bool sound = watch_.trusts(watched(), measured_now, tick.now) && measured_now.has_value();
  // A device that refuses to be switched off is left to its watchdog.
  if (!client_.refuses()) client_.device().refresh();

  if (sound) temperature_ = *measured_now;
  latch(sound, tick);
  bool enable = sound && wanted_ && !latched_ && !client_.refuses();
  if (!enable) primed_ = false;
  if (!drive(enable ? control(temperature_, tick.period) : 0.0, enable)) {
    enable = false;
    if (!std::exchange(told_undriven_, true))
      notices_.say(event::SEVERITY_FAULT, "the control law gives no power that the heater takes: it is off");
  } else if (enable) {
    told_undriven_ = false;
  }
  look_at_response(sound ? measured_now : std::nullopt, tick);
  client_.send(tick.now);
  look_at_delivery(tick);

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
  const auto measured_now = measured(zone.resistance, zone.thermistor);
  if (measured_now) zone.temperature = *measured_now;
  NodeTemperature sample;
  stamp(sample);
  sample.node(id);
  sample.temperature(zone.temperature);
  sample.stale(!measured_now.has_value());
  zone.output->write(sample);
}

}  // namespace invar::thermal
