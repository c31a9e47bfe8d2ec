#include "components/dispenser/dispenser.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/compensation/droplet_model.hpp"
#include "core/compensation/trajectory_file.hpp"
#include "core/model/model_file.hpp"

namespace invar::dispenser {

using namespace dispensing;

namespace {

event::Severity severity_of(modbus::HealthChange::Level level) {
  using Level = modbus::HealthChange::Level;
  if (level == Level::note) return event::SEVERITY_NOTE;
  return level == Level::warning ? event::SEVERITY_WARNING : event::SEVERITY_FAULT;
}

}  // namespace

const modbus::RegisterContract& Dispenser::registers() {
  using enum modbus::RegisterNeed::Access;
  using enum modbus::RegisterNeed::Need;
  static const modbus::RegisterContract contract{
      {"pressure", "Pa", write, needed, "setpoint of the reservoir over ambient"},
      {"actual_pressure", "Pa", read, needed, "pressure of the reservoir over ambient"},
      {"enable", "flag", write, optional, "opens the supply; without it pressure 0 shuts it"},
      {"purge_pressure", "Pa", write, optional, "setpoint of the purge line; without it none is purged"},
      {"purge", "flag", write, optional, "opens the purge valve; without it purge pressure 0 shuts it"},
      {"actual_purge_pressure", "Pa", read, optional, "pressure of the purge line"},
      {"band", "Pa", write, optional, "half width of the band around the setpoint"},
      {"in_band", "flag", read, optional, "enabled, and the reservoir within `band` of the setpoint"},
      {"supply_low", "flag", read, optional, "supply below what the setpoint needs"},
      {"over_pressure", "flag", read, optional, "it has latched: both lines are off"},
      {"sensor_fault", "flag", read, optional, "a pressure sensor is broken: both lines are off"},
      {"comm_lost", "flag", read, optional, "the watchdog of the device has shut it"},
      {"reset_alarms", "flag", write, optional, "set to 1 to clear its latches"}};
  return contract;
}

Dispenser::Dispenser(const Parameters& parameters)
    : parameters_{parameters},
      map_{modbus::load_map_of(parameters.modbus.map, "modbus.map", "pneumatic controller")},
      device_{parameters.modbus.device(map_)},
      model_{*this,
             [this](const std::filesystem::path& file, Staged::Model& model) { return load(file, model); },
             "model", "status"} {
  modbus::MapCheck check{map_, "modbus.map", "pneumatic controller"};
  check.fits(registers());
  check.takes("pressure", {parameters.pressure, parameters.pressure}, "pressure");
  check.takes("purge_pressure", {parameters.purge_pressure, parameters.purge_pressure}, "purge_pressure");
  check.takes("band", {parameters.band, parameters.band}, "band");
  check.takes("reset_alarms", {1.0, 1.0}, "modbus.map");
  check.lets_go({"enable", "pressure"});
  check.lets_go({"purge", "purge_pressure"});
  // A line without a valve is shut by the setpoint 0.
  check.takes(map_.find("enable") ? "enable" : "pressure", {0.0, map_.find("enable") ? 1.0 : 0.0},
              "modbus.map");
  check.takes(map_.find("purge") ? "purge" : "purge_pressure", {0.0, map_.find("purge") ? 1.0 : 0.0},
              "modbus.map");
  check.finish();
  reservoir_ = {map_.find("pressure"), map_.find("enable"), map_.find("actual_pressure")};
  purge_line_ = {map_.find("purge_pressure"), map_.find("purge"), map_.find("actual_purge_pressure")};
  flags_ = {map_.find("in_band"), map_.find("supply_low"), map_.find("over_pressure"),
            map_.find("sensor_fault"), map_.find("comm_lost")};
  band_ = map_.find("band");
  reset_alarms_ = map_.find("reset_alarms");
  const auto taken = [&](std::optional<std::size_t> reg) {
    if (!reg) return Range{0.0, 0.0};
    const Range range = map_.registers[*reg].range;
    return Range{std::max(range.lower, settable.lower), std::min(range.upper, settable.upper)};
  };
  pressures_ = taken(reservoir_.setpoint);
  purge_pressures_ = taken(purge_line_.setpoint);
  for (const Pattern& pattern : parameters.patterns) patterns_[pattern.name] = targets(pattern);
  if (patterns_.size() != parameters.patterns.size())
    throw InputError{"patterns", "two have one name", "rename one of them"};
}

std::vector<Component::Claim> Dispenser::claims() const {
  const bool here = parameters_.modbus.is_on_this_pc();
  std::vector<Claim> all{{device_, "modbus", here}};
  if (!parameters_.modbus.several_masters)
    all.push_back({parameters_.modbus.connection(), "modbus", here, true});
  return all;
}

void Dispenser::configure() {
  model_.open(parameters_.model, "look at the head before raising `bound`");
  client_.open(parameters_.modbus, map_, simulated_time);
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

/// Whether the line is open, as far as the device shows it.
bool Dispenser::is_open(const Line& line, bool told) const {
  if (!line.valve) return told;
  return map_.registers[*line.valve].readable ? client_.flag(line.valve) : told;
}

void Dispenser::drive(const Line& line, double setpoint, bool open) noexcept {
  if (!line.setpoint) return;
  // Out of the map's range but for the last digit cannot be: parameters and commands were checked against it.
  const double wanted = open || line.valve ? setpoint : 0.0;
  (void)client_.write(line.setpoint, map_.registers[*line.setpoint].range.clamp(wanted));
  (void)client_.write(line.valve, open ? 1.0 : 0.0);
}

void Dispenser::drive(bool enable) noexcept {
  driven_ = enable;
  if (band_) (void)client_.write(band_, map_.registers[*band_].range.clamp(parameters_.band));
  drive(purge_line_, purge_setpoint_, enable && purge_);
  drive(reservoir_, setpoint_, enable);
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
  purge_ = command.purge() && purge_line_.setpoint;
  if (command.purge() && !purge_)
    notices_.say(event::SEVERITY_WARNING,
                 "a command to purge is refused: the controller's map has no `purge_pressure`");
  if (command.reset_alarms()) reset_latch();
}

void Dispenser::reset_latch() noexcept {
  latched_ = false;
  reset_at_ = now();
  (void)client_.write(reset_alarms_, 1.0);
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
  const std::int64_t lead_ns = Duration::seconds(path.lead(height)).ns;
  for (const Eigen::Vector2d& target : found->second) {
    const Eigen::Vector2d aimed = path.aim(target, height);
    if (model_.active() != nullptr && !((aimed - target).norm() <= parameters_.bound))
      return "the model moves a target of this pattern beyond its bound; calibrate over the pattern";
    if (model_.active() != nullptr && !(path.sigma(height, aimed) <= parameters_.largest_sigma))
      return "the model is not certain enough over this pattern; calibrate over the pattern";
    TriggerPoint point;
    point.target({target.x(), target.y(), 0.0});
    point.position({aimed.x(), aimed.y(), height});
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
  const modbus::Reading actual = client_.device().value(*reservoir_.actual);
  const bool valve_shown = reservoir_.valve && map_.registers[*reservoir_.valve].readable;
  const bool sound =
      actual.is_sound() && (!valve_shown || client_.device().value(*reservoir_.valve).is_sound());
  PressureState state;
  stamp(state);
  state.node(id);
  state.pressure(actual.value);
  state.setpoint(setpoint_);
  const auto purged = client_.reading(purge_line_.actual);
  state.purge_pressure(purged ? purged->value : std::numeric_limits<double>::quiet_NaN());
  state.enabled(is_open(reservoir_, driven_) && !client_.refuses());
  state.purging(is_open(purge_line_, driven_ && purge_));
  state.supply_low(client_.flag(flags_.supply_low));
  state.over_pressure(latched_ || client_.flag(flags_.over_pressure));
  state.sensor_fault(client_.flag(flags_.sensor_fault));
  state.comm_lost(client_.flag(flags_.comm_lost));
  state.stale(!sound);
  // Both must find it there: the controller may still hold the band of an older setpoint.
  const bool found = flags_.in_band ? client_.flag(flags_.in_band) : state.enabled();
  state.in_band(!state.stale() && !client_.refuses() && found && !state.supply_low() &&
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
    notices_.say(severity_of(change.level), change.text.c_str());
  // A controller that refuses to be shut is left to its watchdog.
  if (!client_.refuses()) client_.device().refresh();
  // A reset takes a few polls to show; the controller itself stays shut until it has accepted it.
  constexpr Duration grace = Duration::milliseconds(500);
  if ((client_.flag(flags_.over_pressure) || client_.flag(flags_.sensor_fault)) &&
      tick.now - reset_at_ > grace)
    latched_ = true;
  drive(wanted_ && !latched_ && !client_.refuses() &&
        !client_.device().value(*reservoir_.actual).out_of_range);
  client_.send(tick.now);
  publish();
}

}  // namespace invar::dispenser
