#include "components/dispenser/dispenser.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/compensation/droplet_model.hpp"
#include "core/compensation/trajectory_file.hpp"
#include "core/model/model_file.hpp"

namespace invar::dispenser {

using namespace dispensing;

Dispenser::Dispenser(const Parameters& parameters)
    : parameters_{parameters},
      model_{*this,
             [this](const std::filesystem::path& file, Staged::Model& model) { return load(file, model); },
             "model", "status"} {
  const auto map = modbus::load_map_of(parameters.modbus.map, "modbus.map", "pneumatic controller",
                                       {{"pressure", "Pa", true},
                                        {"purge_pressure", "Pa", true},
                                        {"band", "Pa", true},
                                        {"enable", "1", true},
                                        {"purge", "1", true},
                                        {"reset_alarms", "1", true},
                                        {"enable"},
                                        {"purge"},
                                        {"actual_pressure", "Pa"},
                                        {"actual_purge_pressure", "Pa"},
                                        {"in_band"},
                                        {"supply_low"},
                                        {"over_pressure"},
                                        {"sensor_fault"},
                                        {"comm_lost"}});
  modbus::must_take(map, "pressure", {parameters.pressure, parameters.pressure}, "pressure");
  modbus::must_take(map, "purge_pressure", {parameters.purge_pressure, parameters.purge_pressure},
                    "purge_pressure");
  device_ = parameters.modbus.device(map);
  modbus::must_let_go(map, "modbus.map", {"enable", "pressure"});
  modbus::must_let_go(map, "modbus.map", {"purge", "purge_pressure"});
  modbus::must_take(map, "band", {parameters.band, parameters.band}, "band");
  const auto taken = [&](const char* reg) {
    const Range range = map.registers[map.find(reg).value()].range;
    return Range{std::max(range.lower, settable.lower), std::min(range.upper, settable.upper)};
  };
  pressures_ = taken("pressure");
  purge_pressures_ = taken("purge_pressure");
  for (const Pattern& pattern : parameters.patterns) patterns_[pattern.name] = targets(pattern);
  if (patterns_.size() != parameters.patterns.size())
    throw InputError{"patterns", "two have one name", "rename one of them"};
}

std::vector<Component::Claim> Dispenser::claims() const {
  return {{device_, "modbus", parameters_.modbus.is_on_this_pc()}};
}

void Dispenser::configure() {
  model_.open(parameters_.model, "look at the head before raising `bound`");
  client_.open(parameters_.modbus, simulated_time);
}

void Dispenser::cleanup() noexcept {
  model_.close();
  client_.close();
}

void Dispenser::activate() {
  setpoint_ = parameters_.pressure;
  purge_setpoint_ = parameters_.purge_pressure;
  wanted_ = parameters_.pressurise;
  purge_ = latched_ = false;
  reset_at_ = Instant{} - Duration::seconds(1.0);
  model_.announce();
}

void Dispenser::deactivate() noexcept {
  if (!client_.is_open()) return;
  wanted_ = purge_ = false;
  drive(false);
  client_.send(now());
}

bool Dispenser::flag(const char* reg) const {
  const modbus::Reading reading = client_.device().value(reg);
  return !reading.stale && reading.value != 0.0;
}

void Dispenser::drive(bool enable) noexcept {
  // Out of the map's range cannot be: parameters and commands were checked against it.
  (void)client_.device().write("pressure", setpoint_);
  (void)client_.device().write("purge_pressure", purge_setpoint_);
  (void)client_.device().write("band", parameters_.band);
  (void)client_.device().write("purge", enable && purge_ ? 1.0 : 0.0);
  (void)client_.device().write("enable", enable ? 1.0 : 0.0);
}

void Dispenser::obey(const PressureCommand& command) noexcept {
  const auto take = [&](double wanted, Range range, double& setpoint) {
    if (wanted == 0.0) return true;  // stays as it is
    if (range.contains(wanted)) setpoint = wanted;
    return range.contains(wanted);
  };
  const bool taken = take(command.setpoint(), pressures_, setpoint_);
  const bool purge_taken = take(command.purge_setpoint(), purge_pressures_, purge_setpoint_);
  if (!taken || !purge_taken) {
    const Range range = taken ? purge_pressures_ : pressures_;
    std::array<char, 200> text{};
    std::snprintf(text.data(), text.size(),
                  "a command's %s of %g Pa is refused: it must be a number from %g to %g",
                  taken ? "purge setpoint" : "setpoint",
                  taken ? command.purge_setpoint() : command.setpoint(), range.lower, range.upper);
    notices_.say(event::SEVERITY_WARNING, text.data());
  }
  wanted_ = command.enabled();
  purge_ = command.purge();
  if (!command.reset_alarms()) return;
  latched_ = false;
  reset_at_ = now();
  (void)client_.device().write("reset_alarms", 1.0);
}

/// Why this model must not move targets; empty: it may.
std::string Dispenser::load(const std::filesystem::path& file, Staged::Model& model) const {
  const auto yaml = config::Yaml::load(file);
  if (yaml.root().has("invar_model")) {
    const auto diagnosed = model::read(yaml);
    yaml.finish();
    if (diagnosed.plant != physics::Plant::droplet)
      return "it is a model of plant " + std::string{physics::name_of(diagnosed.plant)} + ", not of a head";
    model.content = compensation::trajectory_of(diagnosed);
    model.checksum = compensation::checksum_number(compensation::checksum(yaml.text()));
  } else {
    model.content = compensation::load_trajectory(file);
    model.checksum = compensation::check_seal(yaml);
  }
  for (const double height : {model.content.least_height, model.content.most_height})
    if (!(model.content.offset(height).norm() <= parameters_.bound))
      return "it moves targets by more than the bound of " + std::to_string(parameters_.bound * 1e6) + " um";
  return {};
}

/// Why there are no points; empty: there are.
std::string Dispenser::fill(const PatternCommand& command, TriggerPattern& pattern) {
  const auto found = patterns_.find(command.name().c_str());
  if (found == patterns_.end())
    return "`" + std::string{command.name().c_str()} + "` is no pattern of this dispenser";
  const double height = command.height();
  if (!(height > 0.0) || !std::isfinite(height)) return "the height is not a positive number";
  metrology::DropletTrajectory path;
  if (const Staged::Model* model = model_.active(); model != nullptr) {
    path = model->content;
    if (!(path.sigma(height) <= parameters_.largest_sigma))
      return "the model is not certain enough at this height; calibrate there";
    if (!(path.offset(height).norm() <= parameters_.bound))
      return "the model moves targets beyond its bound at this height; calibrate there";
  }
  const Eigen::Vector2d offset = path.offset(height);
  const std::int64_t lead_ns = Duration::seconds(path.lead(height)).ns;
  for (const Eigen::Vector2d& target : found->second) {
    TriggerPoint point;
    point.target({target.x(), target.y(), 0.0});
    point.position({target.x() - offset.x(), target.y() - offset.y(), height});
    point.lead_ns(lead_ns);
    pattern.points().push_back(point);
  }
  return {};
}

void Dispenser::answer(const PatternCommand& command) {
  TriggerPattern pattern;
  stamp(pattern);
  pattern.component_id(id);
  pattern.id(command.id());
  pattern.model_checksum(model_.active() != nullptr ? model_.active()->checksum : 0);
  pattern.refusal(fill(command, pattern));
  for (TriggerPoint& point : pattern.points()) point.droplet(next_droplet_++);
  pattern_.write(pattern);
}

void Dispenser::publish() noexcept {
  const modbus::Reading actual = client_.device().value("actual_pressure");
  const modbus::Reading enabled = client_.device().value("enable");
  PressureState state;
  stamp(state);
  state.node(id);
  state.pressure(actual.value);
  state.setpoint(setpoint_);
  state.purge_pressure(client_.device().value("actual_purge_pressure").value);
  state.enabled(flag("enable") && !client_.refuses());
  state.purging(flag("purge"));
  state.supply_low(flag("supply_low"));
  state.over_pressure(latched_ || flag("over_pressure"));
  state.sensor_fault(flag("sensor_fault"));
  state.comm_lost(flag("comm_lost"));
  state.stale(!actual.is_sound() || !enabled.is_sound());
  // Both must find it there: the controller may still hold the band of an older setpoint.
  state.in_band(!state.stale() && !client_.refuses() && flag("in_band") && !state.supply_low() &&
                std::abs(actual.value - setpoint_) <= parameters_.band);
  pressure_.write(state);
}

void Dispenser::step(const Tick& tick) noexcept {
  PressureCommand command;
  while (command_.take(command)) obey(command);
  (void)model_.update();
  PatternCommand pattern;
  while (wanted_pattern_.take(pattern)) answer(pattern);

  client_.receive(tick.now);
  for (const modbus::HealthChange& change : client_.look(tick.now))
    notices_.say(change.well ? event::SEVERITY_NOTE : event::SEVERITY_FAULT, change.text.c_str());
  // A controller that refuses to be shut is left to its watchdog.
  if (!client_.refuses()) client_.device().refresh();
  // A reset takes a few polls to show; the controller itself stays shut until it has accepted it.
  constexpr Duration grace = Duration::milliseconds(500);
  if ((flag("over_pressure") || flag("sensor_fault")) && tick.now - reset_at_ > grace) latched_ = true;
  drive(wanted_ && !latched_ && !client_.refuses() &&
        !client_.device().value("actual_pressure").out_of_range);
  client_.send(tick.now);
  publish();
}

}  // namespace invar::dispenser
