#include "components/thermal/thermal.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/base/unit.hpp"

namespace invar::thermal {

namespace {

metrology::Thermistor equation_of(const Thermal::Thermistor& parameters) {
  return {parameters.resistance, parameters.base_temperature, parameters.coefficient_percent,
          parameters.third_order};
}

event::Severity severity_of(modbus::HealthChange::Level level) {
  using Level = modbus::HealthChange::Level;
  if (level == Level::note) return event::SEVERITY_NOTE;
  return level == Level::warning ? event::SEVERITY_WARNING : event::SEVERITY_FAULT;
}

}  // namespace

const modbus::RegisterContract& Thermal::registers() {
  using enum modbus::RegisterNeed::Access;
  using enum modbus::RegisterNeed::Need;
  static const modbus::RegisterContract contract{
      {"power", "W or %", write, needed, "setpoint of the pad's power; % of the parameter `rated_power`"},
      {"slide_resistance", "ohm", read, either, "thermistor of the slide"},
      {"slide_temperature", "degC", read, either,
       "temperature of the slide; used where there is no `slide_resistance`"},
      {"enable", "flag", write, optional, "lets the pad heat; without it power 0 is off"},
      {"delivered_power", "W or %", read, optional, "power that flows in fact: shows a relay that sticks"},
      {"comm_lost", "flag", read, optional, "the device's watchdog has switched it off"},
      {"sensor_fault", "flag", read, optional, "a sensor is open or short: the heater is off"},
      {"over_temperature", "flag", read, optional, "the device has latched at its own limit"},
      {"reset_alarms", "flag", write, optional, "set to 1 to clear its latches"}};
  return contract;
}

namespace {

modbus::RegisterContract registers_of_zone(const std::string& zone) {
  using enum modbus::RegisterNeed::Access;
  using enum modbus::RegisterNeed::Need;
  return {{zone + "_resistance", "ohm", read, either, "thermistor of the zone"},
          {zone + "_temperature", "degC", read, either, "temperature of the zone"}};
}

bool is_relative(const modbus::Register& reg) { return conversion(reg.unit, "1").has_value(); }

}  // namespace

Thermal::Thermal(const Parameters& parameters)
    : parameters_{parameters},
      map_{modbus::load_map_of(parameters.modbus.map, "modbus.map", "heater")},
      device_{parameters.modbus.device(map_)} {
  if (map_.heartbeat) lets_go_ = map_.heartbeat->timeout.in_seconds();
  modbus::MapCheck check{map_, "modbus.map", "heater"};
  check.fits(registers());
  for (const Zone& zone : parameters.zones) check.fits(registers_of_zone(zone.name));
  check.lets_go({"enable", "power"});
  check.takes("enable", {0.0, 1.0}, "modbus.map");
  check.takes("reset_alarms", {1.0, 1.0}, "modbus.map");
  const auto power = map_.find("power");
  const auto delivered = map_.find("delivered_power");
  const bool relative = (power && is_relative(map_.registers[*power])) ||
                        (delivered && is_relative(map_.registers[*delivered]));
  if (relative && parameters.rated_power <= 0.0)
    check.fault("rated_power", "missing, and the map counts power in parts of it",
                "say how many watts 100 % are");
  else if (power && is_relative(map_.registers[*power]))
    check.takes("power", {0.0, parameters.power_limit / parameters.rated_power}, "power_limit");
  else
    check.takes("power", {0.0, parameters.power_limit}, "power_limit");
  check.finish();
  find_registers();
}

void Thermal::find_registers() {
  power_register_ = map_.find("power").value();
  enable_ = map_.find("enable");
  delivered_ = map_.find("delivered_power");
  comm_lost_ = map_.find("comm_lost");
  sensor_fault_ = map_.find("sensor_fault");
  over_temperature_ = map_.find("over_temperature");
  reset_alarms_ = map_.find("reset_alarms");
  if (is_relative(map_.registers[power_register_])) power_scale_ = parameters_.rated_power;
  if (delivered_ && is_relative(map_.registers[*delivered_])) delivered_scale_ = parameters_.rated_power;
  slide_ = sensor("slide", parameters_.thermistor);
  for (const Zone& zone : parameters_.zones)
    zones_.push_back({sensor(zone.name, zone.thermistor),
                      std::make_unique<Output<NodeTemperature>>(*this, "temperature_" + zone.name, "state"),
                      unknown});
}

Thermal::Sensor Thermal::sensor(const std::string& of, const Thermistor& thermistor) const {
  return {map_.find(of + "_resistance"), map_.find(of + "_temperature"), equation_of(thermistor)};
}

std::vector<Component::Claim> Thermal::claims() const {
  const bool here = parameters_.modbus.is_on_this_pc();
  std::vector<Claim> all{{device_, "modbus", here}};
  if (!parameters_.modbus.several_masters)
    all.push_back({parameters_.modbus.connection(), "modbus", here, true});
  return all;
}

/// Who stands by takes over only where the device shows that nobody commands it.
std::optional<Component::Unfit> Thermal::without_standby() const {
  if (map_.heartbeat && map_.registers[map_.heartbeat->reg].readable) return {};
  return Unfit{
      "its map has no heartbeat that can be read, by which the standby sees whether somebody commands the "
      "device",
      "modbus", "give the map a `heartbeat` whose register has `access: read_write`"};
}

void Thermal::configure() { client_.open(parameters_.modbus, map_, simulated_time); }

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
  unanswered_.reset();
  beat_changed_.reset();
  unready_since_.reset();
  standby_.activate();
}

bool Thermal::wind_down() noexcept {
  standby_.leave();
  return true;
}

/// What another one drives stays as it is.
void Thermal::deactivate() noexcept {
  if (client_.is_open() && standby_.leads()) {
    (void)drive(0.0, false);
    client_.send(now());
  }
  standby_.resign();
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
  power_ = enable ? power : 0.0;
  // The map takes every power up to the limit but for the last digit: checked when the component was made.
  const Range taken_powers = map_.registers[power_register_].range;
  const bool taken = client_.write(power_register_, taken_powers.clamp(power_ / power_scale_));
  if (!taken) {
    power_ = integral_ = 0.0;
    primed_ = false;
    (void)client_.write(power_register_, 0.0);
  }
  (void)client_.write(enable_, enable && taken ? 1.0 : 0.0);
  return taken;
}

void Thermal::reset_latch() noexcept {
  if (!standby_.leads()) return;  // one that stands by writes nothing: its latch is that of the leader
  latched_ = false;
  watch_.reset();
  reset_at_ = now();
  (void)client_.write(reset_alarms_, 1.0);
}

void Thermal::obey(const ThermalCommand& command) noexcept {
  const double setpoint = command.setpoint();
  if (Parameters::setpoints.contains(setpoint) && setpoint < parameters_.over_temperature) {
    setpoint_ = setpoint;
    wanted_ = command.enabled();
    if (command.reset_latch()) reset_latch();
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
std::optional<double> Thermal::measured(const Sensor& sensor) const noexcept {
  const modbus::Reading reading = client_.device().value(sensor.reg());
  if (!reading.is_sound() || (sensor.resistance && !(reading.value > 0.0))) return {};
  if (const auto fault = client_.reading(sensor_fault_); fault && fault->value != 0.0) return {};
  const double temperature = sensor.resistance ? sensor.thermistor.temperature(reading.value) : reading.value;
  return parameters_.measurable.contains(temperature) ? std::optional{temperature} : std::nullopt;
}

/// What the device's health is, and whether its sensor can be.
void Thermal::tell(bool sound, const Tick& tick) noexcept {
  for (const modbus::HealthChange& change : client_.look(tick.now))
    notices_.say(severity_of(change.level), change.text.c_str());
  const modbus::Reading shown = client_.device().value(slide_.reg());
  // What is stale or outside the map's range was said above.
  const bool impossible = !sound && shown.is_sound();
  if (!impossible) unsound_since_.reset();
  if (impossible && !unsound_since_) unsound_since_ = tick.now;
  constexpr Duration patience = Duration::milliseconds(500);
  if (impossible && !told_unsound_ && tick.now - *unsound_since_ >= patience) {
    told_unsound_ = true;
    std::array<char, 200> text{};
    std::snprintf(
        text.data(), text.size(),
        "the slide's sensor at %g %s is open or short, or the map reads it wrongly: the heater is off",
        shown.value, slide_.resistance ? "ohm" : "degC");
    notices_.say(event::SEVERITY_FAULT, text.data());
  } else if (sound && std::exchange(told_unsound_, false)) {
    notices_.say(event::SEVERITY_NOTE, "the slide's sensor is sound again");
  }
}

/// Too hot: off until somebody resets it. A device that latched by itself is off, whatever it is told.
void Thermal::latch(bool sound, const Tick& tick) noexcept {
  constexpr Duration grace = Duration::milliseconds(500);  // until a reset shows
  const bool hot = sound && temperature_ > parameters_.over_temperature;
  const bool device = client_.flag(over_temperature_) && tick.now - reset_at_ > grace;
  if (!(hot || device) || std::exchange(latched_, true)) return;
  std::array<char, 200> text{};
  if (hot)
    std::snprintf(text.data(), text.size(),
                  "%.4g degC is above `over_temperature`: the heater is off until a person resets the latch",
                  temperature_);
  else
    std::snprintf(text.data(), text.size(),
                  "the controller has switched the heater off at its own limit, the slide at %.4g degC: it "
                  "is off until a "
                  "person resets the latch",
                  temperature_);
  notices_.say(event::SEVERITY_TRIP, text.data());
}

/// A relay that sticks, or another master: the heater is on, and this loop cannot help it.
void Thermal::look_at_delivery(const Tick& tick) noexcept {
  if (!delivered_) return;
  const modbus::Reading delivered = client_.device().value(*delivered_);
  const double watts = delivered.value * delivered_scale_;
  const bool stuck = power_ == 0.0 && delivered.is_sound() && watts > 0.01 * parameters_.power_limit;
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
        watts);
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
        "loose; the heater is off until a person resets the latch",
        leap, temperature_);
  else
    std::snprintf(
        text.data(), text.size(),
        "the heat of %.4g W for %.4g s, given in %.4g s, has not %s (it reads %.4g degC). "
        "A thermistor is off or frozen, or a pad is dead or too weak. The heater is off until a person "
        "resets the latch",
        parameters_.power_limit, within, std::max(before + tick.period, within),
        doubt == Doubt::frozen ? "changed the slide's reading at all" : "warmed the slide as `response` says",
        temperature_);
  notices_.say(event::SEVERITY_TRIP, text.data());
}

void Thermal::step(const Tick& tick) noexcept {
  if (!leads(tick)) return stand_by(tick);
  ThermalCommand command;
  while (command_.take(command)) obey(command);
  if (parameters_.setpoint != setpoint_parameter_) setpoint_ = setpoint_parameter_ = parameters_.setpoint;
  client_.receive(tick.now);
  const auto measured_now = measured(slide_);
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
  sample.watchdog_tripped(client_.flag(comm_lost_));
  sample.stale(!sound);
  state_.write(sample);
  for (ZoneSensor& zone : zones_) publish_zone(zone);
  standby_.tell(*this);
}

void Thermal::publish_zone(ZoneSensor& zone) noexcept {
  const auto measured_now = measured(zone.sensor);
  if (measured_now) zone.temperature = *measured_now;
  NodeTemperature sample;
  stamp(sample);
  sample.node(id);
  sample.temperature(zone.temperature);
  sample.stale(!measured_now.has_value());
  zone.output->write(sample);
}

}  // namespace invar::thermal
